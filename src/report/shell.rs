//! Commands as they are typed.

/// Words as they are typed in a shell.
#[must_use]
pub fn typed<S: AsRef<str>>(words: &[S]) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,+%@".contains(c);
    let quoted = |word: &S| match word.as_ref() {
        word if !word.is_empty() && word.chars().all(plain) => word.to_owned(),
        word => format!("'{}'", word.replace('\'', r"'\''")),
    };
    words.iter().map(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_split_them() {
        let words = ["goniofit", "fit", "my lab.csv", "it's", "a+b.json"];
        assert_eq!(typed(&words), r"goniofit fit 'my lab.csv' 'it'\''s' a+b.json");
    }
}
