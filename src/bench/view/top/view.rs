//! Screen for a state of the node, as a drawing in a buffer: no I/O.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::choices::View;
use super::page::{Block, ScreenRow, arranged, beside, plain};
use super::palette::Palette;
use super::state::State;
use super::text::wrapped;
use super::{budget, head, joints, links, timing, wrenches};

/// Smallest screen.
pub(super) const MIN_SIZE: (u16, u16) = (40, 12);

/// Size from which on there are tables side by side.
const WIDE_SIZE: (usize, usize) = (80, 20);

/// Number of rows of a wide screen beside times and budget.
const OTHER_ROWS: usize = 17;

/// Number of rows from which on the budget is shown beside everything else.
const BUDGET_ROWS: usize = 30;

/// State and choices that the screen shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scene<'a> {
    pub(super) state: &'a State,
    pub(super) view: View,
    pub(super) palette: Palette,
    /// Time since the last line, in s; `None` while lines arrive.
    pub(super) silent_s: Option<u64>,
}

impl Scene<'_> {
    /// Draws all rows of the screen.
    pub(super) fn draw(&self, area: Rect, buffer: &mut Buffer) {
        let (columns, height) = (usize::from(area.width), usize::from(area.height));
        let rows = if area.width < MIN_SIZE.0 || area.height < MIN_SIZE.1 {
            self.too_small(columns, height)
        } else {
            let mut rows = arranged(&self.blocks(columns, height), height - 1);
            rows.resize(height - 1, ScreenRow::default());
            rows.push(head::keys(
                &self.view,
                is_wide(columns, height) && height < BUDGET_ROWS,
                columns,
            ));
            rows
        };
        for (y, row) in (area.y..area.bottom()).zip(rows) {
            buffer.set_line(area.x, y, &row, area.width);
        }
    }

    /// Returns all rows of a screen of this width, without that of the keys.
    pub(super) fn all_rows(&self, columns: usize) -> Vec<ScreenRow> {
        let height = usize::from(u16::MAX);
        arranged(&self.blocks(columns, height), height)
    }

    fn too_small(&self, columns: usize, height: usize) -> Vec<ScreenRow> {
        let (width, rows) = MIN_SIZE;
        let text = format!("{}. frhc top needs {width} × {rows} cells.", self.state.mode_name());
        wrapped(text.trim_start_matches(". "), columns, height).into_iter().map(plain).collect()
    }

    fn blocks(&self, columns: usize, height: usize) -> Vec<Block> {
        let Self { state, view, palette, silent_s } = *self;
        let title = Block::whole(100, vec![head::title(state, &view, palette, columns)]);
        let remarks = head::remarks(state, silent_s, palette, columns);
        let body = if is_wide(columns, height) {
            self.wide(columns, height)
        } else {
            self.narrow(columns)
        };
        [title].into_iter().chain(remarks).chain(body).collect()
    }

    fn wide(&self, columns: usize, height: usize) -> Vec<Block> {
        let Self { state, view, palette, .. } = *self;
        let right = columns.saturating_sub(timing::COLUMNS + 2);
        let mut links = links::buses(state, palette, right);
        links.push(links::bounded_sample_age(state));
        links.extend(links::link(state, palette, right));
        links.extend(links::watchdogs(state, palette, right));
        let extras = [wrenches::gripper(state, columns), wrenches::adjusted(state, columns)];
        let extras: Vec<ScreenRow> = extras.into_iter().flatten().collect();
        // Without a stop, the blocks other than times and budget have at most this many rows.
        links.truncate(height.saturating_sub(OTHER_ROWS + extras.len()).max(timing::ROWS));
        let times = beside(&timing::table(state), timing::COLUMNS + 2, &links);
        let has_both = height >= BUDGET_ROWS;
        let (of_times, of_budget) = match view.is_budget && !has_both {
            true => (20, 85),
            // The way out of a stop is more important than times.
            false if state.cause().is_some() => (60, 20),
            false => (85, 20),
        };
        let short_links = links::short_buses(state, palette);
        let mut blocks = vec![
            Block::gap(),
            Block::whole(78, vec![joints::heading(columns)]),
            Block::whole(95, joints::wide(state, palette, columns)),
            Block::gap(),
            Block::whole(90, wrenches::wide(state)),
            Block::gap(),
            Block::whole(72, vec![wrenches::command(state), wrenches::port(state)]),
            Block::divisible(73, extras),
            Block::gap(),
            Block::abridged((88, short_links), (of_times, times)),
            Block::whole(75, timing::counters(state, palette, columns)),
            Block::divisible(60, timing::others(state, palette, columns)),
        ];
        if has_both || view.is_budget {
            blocks.extend([Block::gap(), Block::whole(of_budget, budget::table(state))]);
        }
        blocks
    }

    fn narrow(&self, columns: usize) -> Vec<Block> {
        let Self { state, palette, .. } = *self;
        let nearest = links::nearest(state, palette, columns);
        let short_links = links::short_buses(state, palette);
        let age = links::bounded_sample_age(state);
        let links = [links::buses(state, palette, columns), vec![age]].concat();
        let extras = [wrenches::gripper(state, columns), wrenches::adjusted(state, columns)];
        vec![
            Block::whole(95, joints::narrow(state, palette, columns)),
            Block::whole(90, vec![wrenches::forces(state)]),
            Block::abridged((88, short_links), (66, links)),
            Block::divisible(70, links::link(state, palette, columns)),
            Block::whole(80, nearest.into_iter().collect()),
            Block::whole(75, wrenches::short_port(state)),
            Block::whole(72, vec![wrenches::short_command(state)]),
            Block::divisible(73, extras.into_iter().flatten().collect()),
            Block::whole(68, timing::counters(state, palette, columns)),
            Block::divisible(60, timing::others(state, palette, columns)),
            Block::whole(55, timing::table(state)),
            Block::divisible(40, wrenches::components(state)),
        ]
    }
}

fn is_wide(columns: usize, height: usize) -> bool {
    columns >= WIDE_SIZE.0 && height >= WIDE_SIZE.1
}
