//! Reference values of independent programs (pinocchio, roboticstoolbox, numpy; each file names its own), in the types
//! of this crate.

use std::fs;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Rotation3, SVector, UnitQuaternion, Vector3};
use serde_json::Value;

use controller::arm::{Arm, JointKind, Link};
use units::spatial::{Twist, Wrench};

/// Maximum difference from a reference value.
pub(crate) const TOLERANCE: f64 = 1e-9;

/// Reads a file of `tests/oracles/`.
pub(crate) fn oracle(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracles").join(name);
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Returns the entries of a list, which must not be empty.
pub(crate) fn list(value: &Value) -> &[Value] {
    let entries = value.as_array().unwrap();
    assert!(!entries.is_empty());
    entries
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

pub(crate) fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let numbers: Vec<f64> = list(value).iter().map(number).collect();
    numbers.try_into().unwrap()
}

pub(crate) fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from(numbers::<3>(value))
}

pub(crate) fn joints(value: &Value) -> SVector<f64, 6> {
    SVector::from(numbers::<6>(value))
}

pub(crate) fn wrench(value: &Value) -> Wrench {
    Wrench::from_components(numbers(value))
}

pub(crate) fn twist(value: &Value) -> Twist {
    Twist::from_components(numbers(value))
}

pub(crate) fn rows<const R: usize, const C: usize>(value: &Value) -> [[f64; C]; R] {
    let rows: Vec<[f64; C]> = list(value).iter().map(numbers).collect();
    rows.try_into().unwrap()
}

pub(crate) fn rotation(value: &Value) -> UnitQuaternion<f64> {
    let [a, b, c] = rows::<3, 3>(value);
    let matrix = Matrix3::from_rows(&[a, b, c].map(|row| Vector3::from(row).transpose()));
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}

pub(crate) fn pose(value: &Value) -> Isometry3<f64> {
    let rows = rows::<4, 4>(value);
    let [a, b, c] =
        [0, 1, 2].map(|row| Vector3::new(rows[row][0], rows[row][1], rows[row][2]).transpose());
    let matrix = Matrix3::from_rows(&[a, b, c]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    let [x, y, z] = [0, 1, 2].map(|row| rows[row][3]);
    Isometry3::from_parts(Vector3::new(x, y, z).into(), rotation)
}

/// Returns a symmetric matrix as xx, yy, zz, xy, xz, yz.
fn symmetric(value: &Value) -> [f64; 6] {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = rows::<3, 3>(value);
    [xx, yy, zz, xy, xz, yz]
}

/// Returns the links of a model, without joint limits.
pub(crate) fn links(model: &Value) -> [Link; 6] {
    let rows = list(&model["rows"]).iter().zip(list(&model["links"]));
    let links: Vec<Link> = rows
        .map(|(row, link)| Link {
            kind: match row["type"].as_str().unwrap() {
                "R" => JointKind::Revolute,
                "P" => JointKind::Prismatic,
                other => panic!("joint type {other}"),
            },
            alpha: number(&row["alpha_im1"]),
            a: number(&row["a_im1"]),
            d: number(&row["d"]),
            theta: number(&row["theta"]),
            mass: number(&link["m"]),
            centre_of_mass: numbers(&link["r"]),
            inertia: symmetric(&link["I"]),
            rotor_inertia: number(&link["armature"]),
            range: [-10.0, 10.0],
        })
        .collect();
    links.try_into().unwrap()
}

/// Returns the arm of a model file.
pub(crate) fn arm(name: &str) -> Arm<6> {
    let model = &oracle(&format!("{name}.json"))["model"];
    Arm::new(links(model), pose(&model["T_6G"]), numbers(&model["g0"])).unwrap()
}

/// Asserts that two lists of numbers are equal within [`TOLERANCE`].
#[track_caller]
pub(crate) fn assert_near(what: &str, ours: &[f64], reference: &[f64]) {
    assert_eq!(ours.len(), reference.len(), "{what}");
    for (ours, reference) in ours.iter().zip(reference) {
        let difference = (ours - reference).abs();
        assert!(
            difference <= TOLERANCE,
            "{what}: {ours} is not {reference}, off by {difference:e}"
        );
    }
}

/// Asserts that the matrices of two poses are equal within [`TOLERANCE`].
#[track_caller]
pub(crate) fn assert_same_pose(what: &str, ours: &Isometry3<f64>, reference: &Isometry3<f64>) {
    let (ours, reference) = (ours.to_homogeneous(), reference.to_homogeneous());
    assert_near(what, ours.as_slice(), reference.as_slice());
}

/// Returns the largest difference between two lists of numbers.
pub(crate) fn farthest(ours: &[f64], reference: &[f64]) -> f64 {
    let differences = ours.iter().zip(reference).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}
