//! [`Failure`]: why a command ended, and the exit code that says whose fault it was.

use std::process::ExitCode;

use incise::Error;
use incise::mesh_io::MeshIoError;
use incise::meshing::MeshingError;

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The input cannot be used: exit code 2.
    Input(anyhow::Error),
    /// The run failed: exit code 1.
    Run(anyhow::Error),
}

impl Failure {
    /// Says it in one sentence and returns the exit code.
    #[expect(
        clippy::print_stderr,
        reason = "this is where the command line speaks of errors"
    )]
    pub(crate) fn report(&self) -> ExitCode {
        let (error, code) = match self {
            Self::Input(error) => (error, 2),
            Self::Run(error) => (error, 1),
        };
        eprintln!("error: {}", sentence(error));
        ExitCode::from(code)
    }
}

/// The error and its causes in one line. Many errors name their cause themselves; it is not said twice.
fn sentence(error: &anyhow::Error) -> String {
    let mut sentence = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !sentence.contains(&cause) {
            sentence = format!("{sentence}: {cause}");
        }
    }
    sentence.replace('\n', " ")
}

/// What cannot be read, understood or written is the input's fault; what goes wrong later is ours.
impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Inconsistent(_) => Self::Run(error.into()),
            _ => Self::Input(error.into()),
        }
    }
}

impl From<MeshIoError> for Failure {
    fn from(error: MeshIoError) -> Self {
        Self::Input(error.into())
    }
}

impl From<MeshingError> for Failure {
    fn from(error: MeshingError) -> Self {
        Self::Input(error.into())
    }
}
