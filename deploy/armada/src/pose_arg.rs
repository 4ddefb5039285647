//! Poses as they are typed: six numbers for people, or JSON.

use armada_model::Pose;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use crate::commands::model::pose;
use crate::exit::UsageError;

/// What a pose argument may be, for help texts.
pub(crate) const HELP: &str = "\
A POSE is X,Y,Z,ROLL,PITCH,YAW in m and degrees, as `armada tcp` prints it; or JSON, @FILE that
holds it, or - for standard input:
  {\"position_m\": {\"x\": 0.4, \"y\": 0, \"z\": 0.2}, \"orientation\": {\"w\": 1, \"x\": 0, \"y\": 0, \"z\": 0}}
  [[1,0,0,0.4], [0,1,0,0], [0,0,1,0.2], [0,0,0,1]]   rows of a 4x4 matrix";

/// The pose that an argument named `option` means.
///
/// # Errors
/// If the file cannot be read; [`UsageError`] if it is no pose.
pub(crate) fn of_argument(option: &str, argument: &str) -> anyhow::Result<Pose> {
    if argument.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.'))
        && argument.len() > 1
    {
        return Ok(of_numbers(argument).map_err(|why| UsageError(format!("{option}: {why}")))?);
    }
    pose::of_argument(option, argument)
}

fn of_numbers(text: &str) -> Result<Pose, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| match part.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!("{:?} is not a number", part.trim())),
        })
        .collect::<Result<_, _>>()?;
    let [x, y, z, roll, pitch, yaw] = <[f64; 6]>::try_from(numbers.as_slice()).map_err(|_| {
        format!("{} numbers, expected X,Y,Z,ROLL,PITCH,YAW in m and degrees", numbers.len())
    })?;
    let turn =
        UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians());
    Ok(Pose::from_isometry(Isometry3::from_parts(Translation3::new(x, y, z), turn)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::words;

    #[test]
    fn six_numbers_are_what_is_printed() {
        let pose = of_argument("--pose", "0.4,-0.1,0.2,180,0,-90").expect("a pose");
        assert_eq!(words::pose(&pose), "0.400 -0.100 0.200 m  180.0 0.0 -90.0°");
    }

    #[test]
    fn anything_but_six_numbers_is_refused_with_what_is_expected() {
        for (text, why) in
            [("1,2,3", "3 numbers, expected X,Y,Z"), ("0,0,0,0,0,NaN", "\"NaN\" is not a number")]
        {
            let error = of_argument("--pose", text).expect_err(text).to_string();
            assert!(error.contains(why) && error.starts_with("--pose"), "{error}");
        }
    }

    #[test]
    fn json_is_a_pose_too() {
        let text = r#"{"position_m":{"x":1,"y":0,"z":0}}"#;
        let pose = of_argument("--pose", text).expect("a pose");
        assert_eq!(pose.position().x, 1.0);
    }
}
