//! Styles of the screen. Words say all that colours say; under `NO_COLOR` no colours are used.

use ratatui::style::{Color, Modifier, Style};

/// Share of a limit from which a value is highlighted.
const NEAR_LIMIT: f64 = 0.8;

/// Styles, with colours or without.
#[derive(Clone, Copy, Debug)]
pub(super) struct Palette {
    /// Set if colours are used.
    pub(super) is_coloured: bool,
}

impl Palette {
    /// Style of headings and of important values.
    pub(super) fn strong() -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    /// Style of a mode's word.
    pub(super) fn mode(self, mode: &str) -> Style {
        let badge = Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED);
        match mode {
            "engaged" | "measuring" => self.coloured(badge, Color::Green),
            "armed" => self.coloured(badge, Color::Cyan),
            "reflection-off" | "zero-torque" | "drives-off" => self.coloured(badge, Color::Red),
            _ => badge,
        }
    }

    /// Style of alarms: drives that are not off, no node.
    pub(super) fn alarm(self) -> Style {
        self.coloured(Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED), Color::Red)
    }

    /// Style of a value beyond its limit, and of a fault.
    pub(super) fn bad(self) -> Style {
        self.coloured(Self::strong(), Color::Red)
    }

    /// Style of a share of a limit.
    pub(super) fn share(self, share: Option<f64>) -> Style {
        match share {
            Some(share) if share >= 1.0 => self.bad(),
            Some(share) if share >= NEAR_LIMIT => self.coloured(Self::strong(), Color::Yellow),
            Some(_) | None => Style::new(),
        }
    }

    fn coloured(self, style: Style, colour: Color) -> Style {
        if self.is_coloured { style.fg(colour) } else { style }
    }
}
