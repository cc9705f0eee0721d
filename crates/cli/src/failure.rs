//! [`Failure`]: an error of a command with its exit code.

use std::process::ExitCode;

use anyhow::anyhow;
use incise::mesh::MeshError;
use incise::mesh_io::MeshIoError;
use incise::meshing::MeshingError;
use incise::{Error, shape_suggestion};

/// An error that ends a command.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Invalid input: exit code 2.
    Input(anyhow::Error),
    /// The run failed: exit code 1.
    Run(anyhow::Error),
}

impl Failure {
    /// Prints the error in one line and returns the exit code.
    #[expect(
        clippy::print_stderr,
        reason = "errors of the command line go to stderr"
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

/// Formats the error and its causes in one line. A cause whose text is part of the error's message is omitted.
fn sentence(error: &anyhow::Error) -> String {
    let mut sentence = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !sentence.contains(&cause) {
            sentence = format!("{sentence}: {cause}");
        }
    }
    if error
        .chain()
        .any(|cause| matches!(cause.downcast_ref(), Some(MeshError::Faulty(_))))
    {
        sentence += "; `incise mesh convert IN OUT --repair` repairs a file";
    }
    sentence.replace('\n', " ")
}

/// Errors of input and files give exit code 2, errors of the simulation 1.
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
        Self::Input(anyhow!("{error}{}", shape_suggestion(&error)))
    }
}
