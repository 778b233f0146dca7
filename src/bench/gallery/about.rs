//! What a scene file says of itself: the comment that it begins with.

/// A title and a description.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct About {
    /// The first sentence, without its full stop.
    pub title: Option<String>,
    /// The rest, empty where there is none.
    pub description: String,
}

/// Reads the comment lines before everything else. A sentence ends at a full stop before a capital letter, or at a comment
/// line that is empty.
pub fn about(text: &str) -> About {
    let lines = text.lines().map(str::trim).skip_while(|line| line.is_empty());
    let lines =
        lines.map_while(|line| line.strip_prefix('#')).map(|line| line.trim_start_matches('#').trim());
    let lines: Vec<&str> = lines.skip_while(|line| line.is_empty()).collect();
    let paragraphs = lines.split(|line| line.is_empty()).map(|lines| lines.join(" "));
    let mut paragraphs = paragraphs.filter(|paragraph| !paragraph.is_empty());
    let Some(first) = paragraphs.next() else { return About::default() };
    let end = first.match_indices(". ").map(|(at, _)| at).find(|at| {
        let next = first[at + 2..].trim_start().chars().next();
        next.is_some_and(char::is_uppercase)
    });
    let (title, rest) = end.map_or((first.as_str(), ""), |at| (&first[..at], first[at + 2..].trim()));
    let title = title.strip_suffix('.').unwrap_or(title).to_owned();
    let rest = [rest.to_owned()].into_iter().filter(|rest| !rest.is_empty());
    let description: Vec<String> = rest.chain(paragraphs).collect();
    About { title: Some(title), description: description.join("\n\n") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_is_a_title_and_a_description() {
        let told = |text: &str| {
            let About { title, description } = about(text);
            (title.unwrap_or_default(), description)
        };
        let plain = |title: &str, description: &str| (title.to_owned(), description.to_owned());
        assert_eq!(told("# A ball of fur.\n\n[mesh]\n# not this\n"), plain("A ball of fur", ""));
        assert_eq!(
            told("\n## Fog,\n# of fig. 5 a. Thin\n# as air.\n#\n# Two.\nx = 1"),
            plain("Fog, of fig. 5 a", "Thin as air.\n\nTwo.")
        );
        assert_eq!(told("#\n# One\n#\n# Two. Three."), plain("One", "Two. Three."));
        for none in ["", "[mesh]\n# A comment.", "#\n#\n"] {
            assert_eq!(about(none), About::default());
        }
    }
}
