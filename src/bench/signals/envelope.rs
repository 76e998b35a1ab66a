//! Smallest and largest values of a signal over time, in constant memory.

/// Values of a span of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bucket {
    /// Time of its first value, in s.
    pub from: f64,
    /// Time of its last value, in s.
    pub to: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Sum of the values, and their number: [`mean`](Self::mean) is their quotient.
    sum: f64,
    count: u32,
}

impl Bucket {
    const fn new(seconds: f64, value: f64) -> Self {
        Self { from: seconds, to: seconds, min: value, max: value, sum: value, count: 1 }
    }

    /// Returns the mean of the values.
    pub fn mean(&self) -> f64 {
        self.sum / f64::from(self.count)
    }

    fn join(self, later: Self) -> Self {
        Self {
            from: self.from,
            to: later.to,
            min: self.min.min(later.min),
            max: self.max.max(later.max),
            sum: self.sum + later.sum,
            count: self.count.saturating_add(later.count),
        }
    }
}

/// Minimum time between two buckets for a gap in the curve, in widths of the first one.
const GAP: f64 = 3.0;

/// Extremes over a span of time; NaN is a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Start, in s.
    pub from: f64,
    /// End, in s; the start of the next span, unless cycles are missing between them.
    pub to: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

/// Envelope of a signal: buckets of equal width, which doubles when their number exceeds the capacity.
#[derive(Clone, Debug)]
pub struct Envelope {
    capacity: usize,
    /// Number of values in a full bucket.
    width: u64,
    /// Number of values added so far, including those that are not finite.
    added: u64,
    /// Buckets; `None` is a gap: no value of the span was finite.
    buckets: Vec<Option<Bucket>>,
}

impl Envelope {
    /// Creates an envelope of at most `capacity` buckets, an even number of at least two.
    pub fn new(capacity: usize) -> Self {
        let capacity = capacity.max(2).next_multiple_of(2);
        Self { capacity, width: 1, added: 0, buckets: Vec::with_capacity(capacity) }
    }

    /// Adds a value at a time in s; times increase. A bucket without finite values is a gap.
    pub fn add(&mut self, seconds: f64, value: f64) {
        if self.added.is_multiple_of(self.width) {
            if self.buckets.len() == self.capacity {
                self.halve();
            }
            self.buckets.push(None);
        }
        self.added += 1;
        if let (true, Some(last)) = (value.is_finite(), self.buckets.last_mut()) {
            let new = Bucket::new(seconds, value);
            *last = Some(last.map_or(new, |bucket| bucket.join(new)));
        }
    }

    /// Returns the buckets in the order of time; `None` for a gap.
    pub fn buckets(&self) -> &[Option<Bucket>] {
        &self.buckets
    }

    /// Returns the buckets as adjacent spans, for a curve.
    pub fn spans(&self) -> Vec<Span> {
        let mut spans: Vec<Span> = Vec::with_capacity(self.buckets.len());
        let mut last_width = 0.0;
        for bucket in &self.buckets {
            let Some(Bucket { from, to, min, max, .. }) = *bucket else {
                // A gap keeps its place; its time is unknown and not needed.
                let at = spans.last().map_or(0.0, |span| span.to);
                spans.push(Span { from: at, to: at, min: f64::NAN, max: f64::NAN });
                continue;
            };
            if let Some(last) = spans.last_mut().filter(|last| last.min.is_finite()) {
                let width = (last.to - last.from).max(last_width);
                if last_width <= 0.0 || from - last.to <= GAP * width {
                    last_width = from - last.from;
                    last.to = from;
                }
            }
            spans.push(Span { from, to, min, max });
        }
        spans
    }

    /// Returns the smallest and the largest value; `None` without any.
    pub fn range(&self) -> Option<[f64; 2]> {
        let whole = self.buckets.iter().copied().flatten().reduce(Bucket::join)?;
        Some([whole.min, whole.max])
    }

    /// Merges pairs of neighbours.
    fn halve(&mut self) {
        let (pairs, _) = self.buckets.as_chunks::<2>();
        let joined = pairs.iter().map(|pair| match *pair {
            [Some(one), Some(other)] => Some(one.join(other)),
            [one, other] => one.or(other),
        });
        let joined: Vec<_> = joined.collect();
        self.buckets.clear();
        self.buckets.extend(joined);
        self.width *= 2;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn envelope_has_the_extremes_of_all_values_in_its_room(
            values in proptest::collection::vec(-1e3_f64..1e3, 1..3_000),
            capacity in 2_usize..50,
        ) {
            let mut envelope = Envelope::new(capacity);
            for (place, value) in (0_u32..).zip(&values) {
                envelope.add(f64::from(place), *value);
            }
            let extremes = |of: fn(f64, f64) -> f64| values.iter().copied().reduce(of).unwrap();
            let expected = [extremes(f64::min), extremes(f64::max)];
            prop_assert_eq!(envelope.range().unwrap().map(f64::to_bits), expected.map(f64::to_bits));
            prop_assert!(envelope.buckets().len() <= capacity.next_multiple_of(2));
            let buckets: Vec<_> = envelope.buckets().iter().map(|bucket| bucket.unwrap()).collect();
            let count: u32 = buckets.iter().map(|bucket| bucket.count).sum();
            prop_assert_eq!(usize::try_from(count).unwrap(), values.len());
            prop_assert!(buckets.windows(2).all(|pair| pair[0].to < pair[1].from));
        }
    }

    #[test]
    fn spans_touch_except_where_cycles_or_values_are_missing() {
        let mut envelope = Envelope::new(8);
        let values = [(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 4.0), (4.0, 4.0), (99.0, 1.0)];
        values.iter().for_each(|(at, value)| envelope.add(*at, *value));
        let spans = envelope.spans();
        let times: Vec<_> = spans.iter().map(|span| (span.from, span.to)).collect();
        assert_eq!(
            times,
            [(0.0, 1.0), (1.0, 1.0), (1.0, 1.0), (3.0, 4.0), (4.0, 4.0), (99.0, 99.0)]
        );
        assert!(spans[2].min.is_nan());
    }

    #[test]
    fn missing_values_are_a_gap() {
        let mut envelope = Envelope::new(8);
        for (seconds, value) in [(0.0, 1.0), (1.0, f64::NAN), (2.0, f64::INFINITY), (3.0, 2.0)] {
            envelope.add(seconds, value);
        }
        let is_there: Vec<bool> = envelope.buckets().iter().map(Option::is_some).collect();
        assert_eq!(is_there, [true, false, false, true]);
        assert_eq!(envelope.range(), Some([1.0, 2.0]));
        assert_eq!(Envelope::new(8).range(), None);
    }
}
