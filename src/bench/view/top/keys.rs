//! Keys that change the view. None acts on the node.

use super::choices::View;

/// Ctrl-C, which a terminal in raw mode passes on as a byte.
const CTRL_C: u8 = 0x03;

/// Escape, and the first byte of the keys that send several.
const ESCAPE: u8 = 0x1b;

/// Returns the choices after these bytes, which were read at once; `None` if a key ends the program.
pub(super) fn after(view: View, bytes: &[u8]) -> Option<View> {
    match bytes {
        [] => Some(view),
        // Escape alone; an arrow or function key sends more bytes at once, and means nothing here.
        [ESCAPE] => None,
        [ESCAPE, ..] => Some(view),
        [first, rest @ ..] => after(pressed(view, *first)?, rest),
    }
}

fn pressed(view: View, key: u8) -> Option<View> {
    match key {
        b'q' | b'Q' | CTRL_C => None,
        b'p' | b'P' => Some(View { is_paused: !view.is_paused, ..view }),
        b'b' | b'B' => Some(View { is_budget: !view.is_budget, ..view }),
        _ => Some(view),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_change_the_view_or_end_the_program() {
        let view = View::default();
        let paused = View { is_paused: true, ..view };
        for bytes in ["", "\u{1b}[A", "\u{1b}OP", "x", "pp", "PpbB"] {
            assert_eq!(after(view, bytes.as_bytes()), Some(view), "{bytes:?}");
        }
        assert_eq!(after(view, b"p"), Some(paused));
        assert_eq!(after(paused, b"b"), Some(View { is_paused: true, is_budget: true }));
        for bytes in ["q", "Q", "\u{1b}", "\u{3}", "pq"] {
            assert_eq!(after(view, bytes.as_bytes()), None, "{bytes:?}");
        }
    }
}
