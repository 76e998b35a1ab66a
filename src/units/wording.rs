//! Formatting of messages, shared by several crates: lists, and equal messages of several nodes as one.

use std::fmt::Display;

/// Joins words as in `1, 2 and 3`.
pub fn listed<T: Display>(words: &[T]) -> String {
    match words {
        [] => String::new(),
        [only] => only.to_string(),
        [first @ .., last] => {
            let first: Vec<_> = first.iter().map(T::to_string).collect();
            format!("{} and {last}", first.join(", "))
        }
    }
}

/// Returns a number with its noun in singular or plural: `1 cycle`, `2 cycles`.
pub fn counted(count: impl Display, noun: &str) -> String {
    let count = count.to_string();
    let ending = if count == "1" { "" } else { "s" };
    format!("{count} {noun}{ending}")
}

/// Removes the sign of a number that is zero at its decimals: `-0.000` is `0.000`.
pub fn without_minus_zero(number: String) -> String {
    match number.strip_prefix('-') {
        Some(digits) if digits.bytes().all(|digit| matches!(digit, b'0' | b'.')) => {
            digits.to_owned()
        }
        Some(_) | None => number,
    }
}

/// Joins messages with semicolons.
pub fn in_one_line<T: Display>(messages: &[T]) -> String {
    messages.iter().map(T::to_string).collect::<Vec<_>>().join("; ")
}

/// Groups subjects with equal messages, in order of first occurrence.
pub fn grouped<S>(messages: impl IntoIterator<Item = (S, String)>) -> Vec<(Vec<S>, String)> {
    let mut groups: Vec<(Vec<S>, String)> = Vec::new();
    for (subject, message) in messages {
        match groups.iter_mut().find(|(_, other)| *other == message) {
            Some((subjects, _)) => subjects.push(subject),
            None => groups.push((vec![subject], message)),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_joined_by_commas_and_and() {
        let lists = [vec![], vec![1], vec![1, 2], vec![1, 2, 3]].map(|words| listed(&words));
        assert_eq!(lists, ["", "1", "1 and 2", "1, 2 and 3"]);
    }

    #[test]
    fn zero_has_no_sign() {
        let numbers = ["-0.000", "-0", "-0.001", "0.0", "-10.0"];
        let expected = ["0.000", "0", "-0.001", "0.0", "-10.0"];
        assert_eq!(numbers.map(|number| without_minus_zero(number.to_owned())), expected);
    }

    #[test]
    fn one_is_singular_and_every_other_number_plural() {
        assert_eq!(
            [0, 1, 2, 11].map(|count| counted(count, "cycle")),
            ["0 cycles", "1 cycle", "2 cycles", "11 cycles"]
        );
    }

    #[test]
    fn equal_messages_are_one_in_the_order_of_the_first() {
        let messages = [(1, "a"), (2, "b"), (3, "a")];
        let groups = grouped(messages.map(|(subject, message)| (subject, message.to_owned())));
        assert_eq!(groups, [(vec![1, 3], "a".to_owned()), (vec![2], "b".to_owned())]);
    }
}
