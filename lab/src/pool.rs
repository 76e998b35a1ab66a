//! Mean, RMS and maximum of several values.

/// Returns the mean; zero without values.
pub(crate) fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = u32::try_from(values.len()).map_or(f64::INFINITY, f64::from);
    values.sum::<f64>() / count.max(1.0)
}

/// Returns the root of the mean square.
pub(crate) fn rms(values: &[f64]) -> f64 {
    mean(values.iter().map(|value| value * value)).sqrt()
}

/// Returns the largest value; zero where none is positive.
pub(crate) fn max(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}
