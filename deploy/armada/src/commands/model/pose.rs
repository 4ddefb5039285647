//! Poses as JSON: as on the wire, or as a matrix.

use armada_model::Pose;
use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Translation3, UnitQuaternion};
use serde_json::Value;

use super::input::{place_of, text_of};
use crate::exit::UsageError;

/// How far a matrix may be from a rigid transform: the tolerance of quaternions on the wire, so
/// that a matrix printed with four digits is taken.
const TOLERANCE: f64 = 1e-3;

/// What a pose argument may be, for help texts.
pub(super) const HELP: &str = "A POSE is JSON, @FILE that holds it, or - for standard input:
  {\"position_m\": {\"x\": 0.4, \"y\": 0, \"z\": 0.2}, \"orientation\": {\"w\": 1, \"x\": 0, \"y\": 0, \"z\": 0}}
  [[1,0,0,0.4], [0,1,0,0], [0,0,1,0.2], [0,0,0,1]]   rows of a 4x4 matrix, also as 16 numbers";

/// Why JSON is not a pose.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum PoseInputError {
    #[error("not JSON: {reason} at {place}")]
    NotJson { reason: String, place: String },
    #[error("neither position_m with orientation nor a 4x4 matrix: {reason}")]
    Shape { reason: String },
    #[error("row {row} column {column} is {value}, which is not a number")]
    NotANumber { row: usize, column: usize, value: String },
    #[error("the last row is {row:?}, expected [0, 0, 0, 1]; rows come one after the other")]
    LastRow { row: [f64; 4] },
    #[error(
        "the rotation is not orthonormal: its columns times each other differ by {off:.3e} from \
         the identity, expected at most {TOLERANCE}"
    )]
    NotOrthonormal { off: f64 },
    #[error("the rotation mirrors: its determinant is {determinant:.3}, expected 1")]
    Mirrored { determinant: f64 },
}

/// The pose that an argument named `option` means.
///
/// # Errors
/// If the file cannot be read; [`UsageError`] if it is no pose.
pub(crate) fn of_argument(option: &str, argument: &str) -> anyhow::Result<Pose> {
    let text = text_of(argument)?;
    Ok(parse(&text).map_err(|error| UsageError(format!("{option}: {error}")))?)
}

/// A pose from JSON.
pub(super) fn parse(text: &str) -> Result<Pose, PoseInputError> {
    let value: Value = serde_json::from_str(text).map_err(|error| {
        let reason = error.to_string();
        let reason = reason.split(" at line").next().unwrap_or_default().to_owned();
        PoseInputError::NotJson { reason, place: place_of(text, &error) }
    })?;
    match value {
        Value::Array(rows) => of_matrix(&matrix(&rows)?),
        Value::Object(ref fields) if !fields.contains_key("position_m") => {
            Err(shape("there is no position_m"))
        }
        other => serde_json::from_value(other).map_err(|error| shape(&error.to_string())),
    }
}

/// The 4x4 matrix of a pose, row by row.
pub(super) fn rows(pose: &Pose) -> [[f64; 4]; 4] {
    let matrix = pose.isometry().to_homogeneous();
    [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| matrix[(row, column)]))
}

fn shape(reason: &str) -> PoseInputError {
    PoseInputError::Shape { reason: reason.to_owned() }
}

/// Four rows of four, or sixteen numbers row by row.
fn matrix(rows: &[Value]) -> Result<Matrix4<f64>, PoseInputError> {
    let nested: Option<Vec<&Vec<Value>>> = rows.iter().map(Value::as_array).collect();
    let cells: Vec<&Value> = match nested {
        Some(rows) if rows.len() == 4 && rows.iter().all(|row| row.len() == 4) => {
            rows.into_iter().flatten().collect()
        }
        None if rows.len() == 16 => rows.iter().collect(),
        _ => return Err(shape("a matrix has 4 rows of 4 numbers, or 16 numbers")),
    };
    let mut matrix = Matrix4::zeros();
    for (index, cell) in cells.into_iter().enumerate() {
        let (row, column) = (index / 4, index % 4);
        matrix[(row, column)] =
            cell.as_f64().filter(|value| value.is_finite()).ok_or_else(|| {
                PoseInputError::NotANumber {
                    row: row + 1,
                    column: column + 1,
                    value: cell.to_string(),
                }
            })?;
    }
    Ok(matrix)
}

/// The rigid transform nearest to a matrix that nearly is one.
fn of_matrix(matrix: &Matrix4<f64>) -> Result<Pose, PoseInputError> {
    let row: [f64; 4] = [0, 1, 2, 3].map(|column| matrix[(3, column)]);
    let off = |(value, expected): (f64, f64)| (value - expected).abs() > TOLERANCE;
    if row.into_iter().zip([0.0, 0.0, 0.0, 1.0]).any(off) {
        return Err(PoseInputError::LastRow { row });
    }
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let off = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    if off > TOLERANCE {
        return Err(PoseInputError::NotOrthonormal { off });
    }
    let determinant = rotation.determinant();
    if determinant < 0.0 {
        return Err(PoseInputError::Mirrored { determinant });
    }
    // Source: Higham, "Matrix nearness problems and applications", 1989: the nearest rotation is
    // the orthogonal factor of the polar decomposition.
    let svd = rotation.svd(true, true);
    let nearest = svd.u.zip(svd.v_t).map_or(rotation, |(u, v_t)| u * v_t);
    let orientation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(nearest));
    let position: Translation3<f64> = matrix.fixed_view::<3, 1>(0, 3).into_owned().into();
    Ok(Pose::from_isometry(Isometry3::from_parts(position, orientation)))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn sample() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(0.1, -2.0, 3.5), Vector3::new(0.4, 3.0, -0.6))
    }

    fn text_of_rows(matrix: &Matrix4<f64>) -> String {
        let row = |row: usize| [0, 1, 2, 3].map(|column| matrix[(row, column)]);
        serde_json::to_string(&[0, 1, 2, 3].map(row)).expect("numbers")
    }

    #[test]
    fn wire_form_rows_and_sixteen_numbers_are_the_same_pose() {
        let matrix = sample().to_homogeneous();
        let wire = serde_json::to_string(&Pose::from_isometry(sample())).expect("a pose");
        let flat = text_of_rows(&matrix).replace("],[", ",").replace("[[", "[").replace("]]", "]");
        for text in [wire, text_of_rows(&matrix), flat] {
            let (distance, angle) =
                parse(&text).expect(&text).distance(&Pose::from_isometry(sample()));
            assert!(distance < 1e-15 && angle < 1e-7, "{text}: {distance} m, {angle} rad");
        }
    }

    #[test]
    fn a_matrix_of_four_digits_becomes_the_nearest_rotation() {
        let rounded = sample().to_homogeneous().map(|value| (value * 1e4).round() / 1e4);
        let pose = parse(&text_of_rows(&rounded)).expect("near enough");
        let (distance, angle) = pose.distance(&Pose::from_isometry(sample()));
        assert!(distance < 1e-4 && angle < 1e-4, "{distance} m, {angle} rad");
    }

    #[test]
    fn a_half_turn_is_taken_about_any_axis() {
        for axis in [Vector3::x(), Vector3::y(), Vector3::new(0.6, 0.0, 0.8)] {
            let turn = Isometry3::rotation(axis * std::f64::consts::PI);
            let pose = parse(&text_of_rows(&turn.to_homogeneous())).expect("a rotation");
            let (_, angle) = pose.distance(&Pose::from_isometry(turn));
            assert!(angle < 1e-7, "{axis}: {angle}");
        }
    }

    #[test]
    fn what_is_no_pose_is_refused_with_its_reason() {
        for (text, reason) in [
            ("[", "not JSON: EOF while parsing a list at line 1 column 1"),
            ("[1, NaN]", "not JSON: expected value at line 1 column 5"),
            ("[[1,0],[0,1]]", "a matrix has 4 rows of 4 numbers, or 16 numbers"),
            ("[1,2,3]", "a matrix has 4 rows of 4 numbers, or 16 numbers"),
            ("{}", "there is no position_m"),
            (r#"{"position_m":{"x":0,"y":0,"z":0},"rpy":[0,0,0]}"#, "unknown field `rpy`"),
            (
                r#"{"position_m":{"x":0,"y":0,"z":0},"orientation":{"w":2,"x":0,"y":0,"z":0}}"#,
                "orientation has norm 2, expected 1 within 0.001",
            ),
            ("[[1,0,0,0],[0,1,0,0],[0,0,1,\"up\"],[0,0,0,1]]", "row 3 column 4 is \"up\""),
            ("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[1,2,3,1]]", "the last row is [1.0, 2.0, 3.0, 1.0]"),
            ("[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]", "not orthonormal: its columns"),
            ("[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]", "mirrors: its determinant is -1.000"),
        ] {
            let error = parse(text).expect_err(text).to_string();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
