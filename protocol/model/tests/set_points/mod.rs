//! What a loop sends to a joint, and what can be seen of it from behind.
#![allow(dead_code, reason = "each test binary uses a part of this module")]

/// The last four set-points of one joint with their times, the newest last.
#[derive(Default)]
pub(crate) struct SetPoints {
    at: [(f64, f64); 4],
    count: usize,
}

impl SetPoints {
    pub(crate) fn push(&mut self, time_s: f64, value: f64) {
        self.at.rotate_left(1);
        self.at[3] = (time_s, value);
        self.count += 1;
    }

    /// The mean of derivative `order`, at most three, over the last `order + 1` set-points: their
    /// divided difference times the factorial of the order, whatever their times are.
    pub(crate) fn mean_derivative(&self, order: usize) -> Option<f64> {
        if self.count <= order {
            return None;
        }
        let times = self.at.map(|point| point.0);
        let mut row = self.at.map(|point| point.1);
        let mut factorial = 1.0;
        for level in 1..=order {
            for index in (3 - order + level..=3).rev() {
                row[index] = (row[index] - row[index - 1]) / (times[index] - times[index - level]);
            }
            factorial *= [1.0, 1.0, 2.0, 3.0][level];
        }
        Some(factorial * row[3])
    }
}

#[test]
fn differences_of_a_cubic_are_its_derivatives() {
    let mut points = SetPoints::default();
    for time_s in [0.0, 0.5, 0.6, 2.0] {
        points.push(time_s, time_s * time_s * time_s);
    }
    assert!((points.mean_derivative(3).unwrap_or_default() - 6.0).abs() < 1e-12);
    let slope = (8.0 - 0.216) / 1.4;
    assert!((points.mean_derivative(1).unwrap_or_default() - slope).abs() < 1e-12);
    // f[a, b, c] of x³ is a + b + c.
    assert!((points.mean_derivative(2).unwrap_or_default() - 2.0 * 3.1).abs() < 1e-12);
}
