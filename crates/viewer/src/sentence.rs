//! [`sentence`]: an error with its causes as text for dialogs, a terminal and a page.

/// Formats an error and its causes. A cause whose text is part of the error's message is omitted.
pub(crate) fn sentence(error: &anyhow::Error) -> String {
    let mut sentence = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !sentence.contains(&cause) {
            sentence = format!("{sentence}: {cause}");
        }
    }
    sentence
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;

    use super::*;

    #[test]
    fn a_cause_is_named_once() {
        let error = anyhow!("ask for 200 tets");
        let error = error.context("body[0].shape: ask for 200 tets");
        let error = error.context("scene.toml: line 2");
        assert_eq!(
            sentence(&error),
            "scene.toml: line 2: body[0].shape: ask for 200 tets"
        );
    }
}
