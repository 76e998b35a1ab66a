//! Figures of one axis from its measured curve: plateau, edge of the deadband, hysteresis and wall.

use serde::Serialize;

use crate::return_to_centre::curve::Point;

/// Start of the plateau, in half-widths of the deadband, and its end as a share of the reach.
const PLATEAU_FROM: f64 = 1.25;
const PLATEAU_TO: f64 = 0.92;

/// Steps of the search for the edge of the deadband.
const STEPS: u16 = 2_000;

/// Minimum number of points for the slope of the wall.
const MIN_POINTS: usize = 3;

/// Configured return to centre of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Law {
    /// Half-width of the deadband, in m or rad.
    pub deadband: f64,
    /// Plateau, in N or N·m.
    pub plateau: f64,
    /// Displacement of the wall, in m or rad; `None` without one.
    pub wall: Option<f64>,
}

/// Figures of the curve, both sides together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Plateau commanded by the controller, in N or N·m.
    pub commanded: f64,
    /// Plateau at the hand, mean of both directions, in N or N·m.
    pub felt: f64,
    /// Edge of the deadband that fits the forces on the hand best, in m or rad; absent without a plateau.
    pub edge: Option<f64>,
    /// Width of the hysteresis on the plateau, in N or N·m.
    pub hysteresis: f64,
    /// Part of the hysteresis that is damping K_D, in N or N·m; the rest is friction.
    pub damping: f64,
    /// Stiffness of the wall at the hand, in N/m or N·m/rad.
    pub wall_stiffness: Option<f64>,
}

impl Figures {
    /// Evaluates `points` within `reach`, in m or rad; `None` without a point on the plateau.
    pub fn from_curve(points: &[Point], law: &Law, reach: f64) -> Option<Self> {
        let end = law.wall.unwrap_or(f64::INFINITY).min(PLATEAU_TO * reach);
        let is_plateau = |point: &&Point| {
            (PLATEAU_FROM * law.deadband..end).contains(&point.x.abs()) && point.x.abs() > 0.0
        };
        let plateau: Vec<&Point> = points.iter().filter(is_plateau).collect();
        let mean = |value: fn(&Point) -> f64| {
            let values = plateau.iter().map(|point| value(point));
            values.sum::<f64>() / f64::from(u32::try_from(plateau.len()).unwrap_or(u32::MAX))
        };
        let pulls = |force: f64, x: f64| -force * x.signum();
        let within: Vec<[f64; 2]> = points
            .iter()
            .filter(|point| point.x.abs() < end)
            .map(|point| [point.x.abs(), pulls(point.felt(), point.x)])
            .collect();
        (!plateau.is_empty()).then(|| Self {
            commanded: mean(|point| -point.commanded * point.x.signum()),
            felt: mean(|point| -point.felt() * point.x.signum()),
            edge: edge(&within, end.min(reach)).filter(|_| law.plateau > 0.0),
            hysteresis: mean(Point::hysteresis),
            damping: mean(|point| 2.0 * point.damping),
            wall_stiffness: law.wall.and_then(|wall| wall_stiffness(points, wall, reach)),
        })
    }
}

/// Returns the edge `e` of `F0 min(1, x/e)²` that fits the forces best. `None` where it is not within 2 and 98 % of `end`,
/// as for a spring.
fn edge(forces: &[[f64; 2]], end: f64) -> Option<f64> {
    let places = (1..STEPS).map(|step| end * f64::from(step) / f64::from(STEPS));
    let best = places.min_by(|a, b| misfit(forces, *a).total_cmp(&misfit(forces, *b)))?;
    (0.02 * end..0.98 * end).contains(&best).then_some(best)
}

/// Returns the sum of squared residuals of the best plateau with its edge at `edge`.
fn misfit(forces: &[[f64; 2]], edge: f64) -> f64 {
    let share = |x: f64| (x / edge).min(1.0).powi(2);
    let (product, square) = forces.iter().fold((0.0, 0.0), |(product, square), [x, force]| {
        (product + share(*x) * force, square + share(*x).powi(2))
    });
    let plateau = if square > 0.0 { product / square } else { 0.0 };
    forces.iter().map(|[x, force]| (force - plateau * share(*x)).powi(2)).sum()
}

/// Returns the slope of the force on the hand beyond `wall`, in N/m or N·m/rad; `None` with too few points.
fn wall_stiffness(points: &[Point], wall: f64, reach: f64) -> Option<f64> {
    let is_beyond = |point: &&Point| (wall..reach).contains(&point.x.abs());
    let beyond: Vec<[f64; 2]> = points
        .iter()
        .filter(is_beyond)
        .map(|point| [point.x.abs(), -point.felt() * point.x.signum()])
        .collect();
    let count = f64::from(u32::try_from(beyond.len()).ok()?);
    let mean = |place: fn(&[f64; 2]) -> f64| beyond.iter().map(place).sum::<f64>() / count;
    let (x_mean, force_mean) = (mean(|[x, _]| *x), mean(|[_, force]| *force));
    let (product, square) = beyond.iter().fold((0.0, 0.0), |(product, square), [x, force]| {
        (product + (x - x_mean) * (force - force_mean), square + (x - x_mean).powi(2))
    });
    (beyond.len() >= MIN_POINTS && square > 0.0).then_some(product / square)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: Law = Law { deadband: 0.01, plateau: 2.0, wall: Some(0.04) };
    const REACH: f64 = 0.05;

    /// Returns the curve of Eq. 8 with a wall of 300 N/m, its edge at `edge`, and friction of 0.25 N.
    fn points(edge: f64) -> Vec<Point> {
        let point = |step: i32| {
            let x = (f64::from(step) + 0.5) * 0.001;
            let size = x.abs();
            let force = 2.0 * (size / edge).min(1.0).powi(2) + 300.0 * (size - 0.04).max(0.0);
            let law = -force * x.signum();
            let friction = 0.25 * x.signum();
            let (felt_out, felt_back) = (law - friction, law + friction);
            Point { x, law, commanded: law, felt_out, felt_back, damping: 0.0 }
        };
        (-50..50).map(point).collect()
    }

    #[test]
    fn figures_of_the_law_are_those_of_its_settings() {
        let figures = Figures::from_curve(&points(0.01), &LAW, REACH).unwrap();
        assert!((figures.commanded - 2.0).abs() < 1e-12 && (figures.felt - 2.0).abs() < 1e-12);
        assert!((figures.hysteresis - 0.5).abs() < 1e-12);
        assert!((figures.edge.unwrap() - 0.01).abs() < 1e-4, "{figures:?}");
        assert!((figures.wall_stiffness.unwrap() - 300.0).abs() < 1e-6, "{figures:?}");
    }

    #[test]
    fn edge_is_found_where_the_hand_feels_it() {
        let figures = Figures::from_curve(&points(0.014), &LAW, REACH).unwrap();
        assert!((figures.edge.unwrap() - 0.014).abs() < 2e-4, "{figures:?}");
    }

    #[test]
    fn spring_has_no_edge() {
        let law = Law { wall: None, ..LAW };
        assert_eq!(Figures::from_curve(&points(1.0), &law, REACH).unwrap().edge, None);
    }

    #[test]
    fn axis_that_was_not_crossed_has_no_figures() {
        assert_eq!(Figures::from_curve(&[], &LAW, REACH), None);
    }
}
