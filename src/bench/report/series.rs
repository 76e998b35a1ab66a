//! Envelopes of one quantity: a number for each joint, component or bus.

use picture::strip::{Curve, Extent};
use signals::{Envelope, Span};

/// Buckets of an envelope: more than a picture has pixels across.
const BUCKETS: usize = 1_000;

/// Envelopes of the numbers of one quantity.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    envelopes: Vec<Envelope>,
}

impl Series {
    /// Creates as many empty envelopes.
    pub(crate) fn new(numbers: usize) -> Self {
        Self { envelopes: vec![Envelope::new(BUCKETS); numbers] }
    }

    /// Adds the numbers of a cycle; without any, a gap.
    pub(crate) fn add(&mut self, seconds: f64, values: Option<&[f64]>) {
        for (place, envelope) in self.envelopes.iter_mut().enumerate() {
            let value = values.and_then(|values| values.get(place).copied());
            envelope.add(seconds, value.unwrap_or(f64::NAN));
        }
    }

    /// Returns whether there is any number.
    pub(crate) fn is_empty(&self) -> bool {
        self.envelopes.iter().all(|envelope| envelope.range().is_none())
    }

    /// Returns least and greatest number at a place.
    pub(crate) fn range(&self, place: usize) -> Option<[f64; 2]> {
        self.envelopes.get(place).and_then(Envelope::range)
    }

    /// Returns whether the number at a place is other than zero in any cycle.
    pub(crate) fn is_used(&self, place: usize) -> bool {
        self.range(place).is_some_and(|[low, high]| low < 0.0 || high > 0.0)
    }

    /// Returns the numbers at a place as a curve, each times `scale`, their times less `zero`.
    pub(crate) fn curve(&self, place: usize, name: &str, scale: f64, zero: f64) -> Curve {
        Curve::new(
            name,
            self.envelopes.get(place).map(|of| extents(of, scale, zero)).unwrap_or_default(),
        )
    }

    /// Returns the curves of several places with their names.
    pub(crate) fn curves(&self, from: usize, names: &[&str], scale: f64) -> Vec<Curve> {
        let places = (from..).zip(names);
        places.map(|(place, name)| self.curve(place, name, scale, 0.0)).collect()
    }
}

/// Returns the extents of an envelope, each times `scale`, their times less `zero`.
fn extents(envelope: &Envelope, scale: f64, zero: f64) -> Vec<Extent> {
    let extent = |Span { from, to, min, max }| {
        let [low, high] = [min * scale, max * scale];
        let (from, to) = (from - zero, to - zero);
        // A negative scale exchanges them; NaN stays.
        let [min, max] = if scale < 0.0 { [high, low] } else { [low, high] };
        Extent { from, to, min, max }
    };
    envelope.spans().into_iter().map(extent).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extents_are_scaled_and_begin_at_zero() {
        let mut series = Series::new(1);
        for (at, value) in
            [(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 4.0), (4.0, 4.0), (99.0, 1.0)]
        {
            series.add(at, Some(&[value]));
        }
        let extents = series.curve(0, "one", 10.0, 1.0).extents;
        let times: Vec<_> = extents.iter().map(|extent| (extent.from, extent.to)).collect();
        assert_eq!(
            times,
            [(-1.0, 0.0), (0.0, 0.0), (0.0, 0.0), (2.0, 3.0), (3.0, 3.0), (98.0, 98.0)]
        );
        assert!(extents[2].min.is_nan());
        assert_eq!(extents[1].max.to_bits(), 20.0_f64.to_bits());
        assert_eq!(series.range(0), Some([1.0, 4.0]));
    }

    #[test]
    fn series_without_numbers_is_empty() {
        let mut series = Series::new(2);
        series.add(0.0, None);
        assert!(series.is_empty() && !series.is_used(0));
        series.add(1.0, Some(&[0.0]));
        assert!(!series.is_empty() && !series.is_used(0));
    }
}
