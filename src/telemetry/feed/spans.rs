//! Minima and maxima between two snapshots, so that no peak is missed.

use serde::Serialize;

use node::record::Record;

/// Minimum and maximum of each of six numbers.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Span {
    min: [f64; 6],
    max: [f64; 6],
}

impl Span {
    /// Span of no values: infinite, which is `null` in JSON.
    const NONE: Self = Self { min: [f64::INFINITY; 6], max: [f64::NEG_INFINITY; 6] };

    fn add(&mut self, values: [f64; 6]) {
        for ((min, max), value) in self.min.iter_mut().zip(&mut self.max).zip(values) {
            *min = min.min(value);
            *max = max.max(value);
        }
    }
}

/// Spans of the quantities that change within a snapshot's interval.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Spans {
    f_s: Span,
    f_g_task: Span,
    tau: Span,
    v_g: Span,
}

impl Spans {
    /// Spans of no cycles.
    pub(super) const NONE: Self =
        Self { f_s: Span::NONE, f_g_task: Span::NONE, tau: Span::NONE, v_g: Span::NONE };

    /// Adds a cycle.
    pub(super) fn add(&mut self, record: &Record) {
        let output = &record.output;
        self.f_s.add(record.f_s.components());
        self.f_g_task.add(output.f_g_task.components());
        self.tau.add(output.tau.into());
        self.v_g.add(output.twist.v_g.components());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn span_has_least_and_greatest_value_and_ignores_nan() {
        let mut span = Span::NONE;
        let of = |value: f64| [value, 0.0, 0.0, 0.0, 0.0, f64::NAN];
        [2.0, -3.0, 1.0].into_iter().for_each(|value| span.add(of(value)));
        assert!((span.min[0] + 3.0).abs() < 1e-12 && (span.max[0] - 2.0).abs() < 1e-12);
        let text = serde_json::to_string(&span).unwrap();
        assert_eq!(text, r#"{"min":[-3.0,0.0,0.0,0.0,0.0,null],"max":[2.0,0.0,0.0,0.0,0.0,null]}"#);
    }
}
