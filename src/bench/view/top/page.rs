//! Blocks of rows, one below the other; where a terminal has too few rows, the most important ones.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::text::fitted;

/// One line of styled text, cut at the width of the screen.
pub(super) type ScreenRow = Line<'static>;

/// Rows that belong together.
#[derive(Clone, Debug)]
pub(super) struct Block {
    rows: Vec<ScreenRow>,
    importance: u8,
    is_divisible: bool,
    /// Rows that are shown instead where there is room for them, and their importance.
    fuller: Option<(u8, Vec<ScreenRow>)>,
}

impl Block {
    /// Creates a block that is shown completely or not at all.
    pub(super) fn whole(importance: u8, rows: Vec<ScreenRow>) -> Self {
        Self { rows, importance, is_divisible: false, fuller: None }
    }

    /// Creates a block whose first rows are shown where there is no room for all.
    pub(super) fn divisible(importance: u8, rows: Vec<ScreenRow>) -> Self {
        Self { is_divisible: true, ..Self::whole(importance, rows) }
    }

    /// Creates a block with a short form for screens without room for the full one. Each form has its importance.
    pub(super) fn abridged(short: (u8, Vec<ScreenRow>), fuller: (u8, Vec<ScreenRow>)) -> Self {
        Self { fuller: Some(fuller), ..Self::whole(short.0, short.1) }
    }

    /// Creates an empty row, shown only if all other blocks have room.
    pub(super) fn gap() -> Self {
        Self::whole(0, vec![ScreenRow::default()])
    }

    /// Returns the number of rows that are shown in this room.
    fn height_in(&self, room: usize) -> usize {
        match self.rows.len() {
            height if height <= room => height,
            _ if self.is_divisible => room,
            _ => 0,
        }
    }
}

/// Block, or its fuller form, that is given room.
#[derive(Clone, Copy, Debug)]
struct Claim {
    importance: u8,
    place: usize,
    is_fuller: bool,
}

/// Returns the rows of the most important blocks, in the order of the blocks: at most `height`.
pub(super) fn arranged(blocks: &[Block], height: usize) -> Vec<ScreenRow> {
    let claims = |(place, block): (usize, &Block)| {
        let first = Claim { importance: block.importance, place, is_fuller: false };
        let fuller = block.fuller.as_ref();
        [
            Some(first),
            fuller.map(|(importance, _)| Claim { importance: *importance, place, is_fuller: true }),
        ]
    };
    let mut ranking: Vec<Claim> = blocks.iter().enumerate().flat_map(claims).flatten().collect();
    ranking.sort_by_key(|claim| std::cmp::Reverse(claim.importance));
    let mut shown: Vec<&[ScreenRow]> = vec![&[]; blocks.len()];
    let mut room = height;
    for Claim { place, is_fuller, .. } in ranking {
        let (Some(block), Some(rows)) = (blocks.get(place), shown.get_mut(place)) else { continue };
        room += rows.len();
        match &block.fuller {
            Some((_, fuller)) if is_fuller && fuller.len() <= room => *rows = fuller,
            Some(_) | None if is_fuller => {}
            Some(_) | None => *rows = block.rows.get(..block.height_in(room)).unwrap_or_default(),
        }
        room -= rows.len();
    }
    shown.concat()
}

/// Returns a row of texts, each with its style.
pub(super) fn row<const N: usize>(parts: [(String, Style); N]) -> ScreenRow {
    ScreenRow::from(parts.map(|(text, style)| Span::styled(text, style)).to_vec())
}

/// Returns a row in the default style.
pub(super) fn plain(text: impl Into<String>) -> ScreenRow {
    ScreenRow::from(text.into())
}

/// Returns rows side by side: the left ones have `width` columns.
pub(super) fn beside(left: &[ScreenRow], width: usize, right: &[ScreenRow]) -> Vec<ScreenRow> {
    let side = |place: usize| {
        let mut whole = left.get(place).cloned().unwrap_or_default();
        let blank = width.saturating_sub(whole.width());
        whole.push_span(Span::raw(fitted("", blank)));
        whole.extend(right.get(place).cloned().unwrap_or_default());
        whole
    };
    (0..left.len().max(right.len())).map(side).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(importance: u8, name: &str, rows: usize) -> Vec<ScreenRow> {
        (0..rows).map(|_| plain(format!("{name}{importance}"))).collect()
    }

    #[test]
    fn most_important_blocks_are_shown_in_their_order() {
        let blocks = [
            Block::whole(9, block(9, "a", 1)),
            Block::gap(),
            Block::whole(1, block(1, "b", 3)),
            Block::whole(5, block(5, "c", 2)),
            Block::divisible(3, block(3, "d", 3)),
        ];
        let shown = |height| {
            let rows = arranged(&blocks, height);
            rows.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(shown(0), "");
        assert_eq!(shown(1), "a9");
        assert_eq!(shown(2), "a9 d3", "one row is too few for c");
        assert_eq!(shown(4), "a9 c5 c5 d3");
        assert_eq!(shown(9), "a9 b1 b1 b1 c5 c5 d3 d3 d3");
        assert_eq!(shown(99), "a9  b1 b1 b1 c5 c5 d3 d3 d3");
    }

    #[test]
    fn fuller_form_of_a_block_needs_room_behind_others() {
        let fuller = (2, block(2, "full", 3));
        let blocks =
            [Block::abridged((9, block(9, "short", 1)), fuller), Block::whole(5, block(5, "b", 1))];
        let shown = |height| {
            arranged(&blocks, height).iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(shown(1), "short9");
        assert_eq!(shown(3), "short9 b5");
        assert_eq!(shown(4), "full2 full2 full2 b5");
    }

    #[test]
    fn sides_of_different_heights_stand_beside_each_other() {
        let rows = beside(&[plain("ab")], 4, &[plain("x"), plain("y")]);
        let texts: Vec<String> = rows.iter().map(ToString::to_string).collect();
        assert_eq!(texts, ["ab  x", "    y"]);
    }
}
