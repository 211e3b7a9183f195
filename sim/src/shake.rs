//! Where is the hand at time t of a shake?

use std::f64::consts::{PI, TAU};

/// One shake: an oscillation under a sin^2 window, so that it starts and ends at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shake {
    /// Amplitude, metres or radians.
    pub amplitude: f64,
    /// Frequency, Hz.
    pub hz: f64,
    /// Cycles.
    pub cycles: f64,
}

impl Shake {
    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        if self.amplitude == 0.0 {
            0.0
        } else {
            self.cycles / self.hz
        }
    }

    /// Largest acceleration, in units of the amplitude's unit per s2.
    pub fn peak_acceleration(&self) -> f64 {
        let (n, duration) = (2000, self.duration_s());
        let h = duration / f64::from(n);
        (1..n)
            .map(|i| {
                let t = f64::from(i) * h;
                let bend = self.offset(t - h) - 2.0 * self.offset(t) + self.offset(t + h);
                (bend / (h * h)).abs()
            })
            .fold(0.0, f64::max)
    }

    /// Deflection at `t` seconds from its start, in units of the amplitude's unit.
    pub fn offset(&self, t: f64) -> f64 {
        let duration = self.duration_s();
        if t <= 0.0 || t >= duration {
            return 0.0;
        }
        let window = (PI * t / duration).sin().powi(2);
        self.amplitude * window * (TAU * self.hz * t).sin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shake_starts_and_ends_at_rest_and_stays_within_its_amplitude() {
        let shake = Shake {
            amplitude: 0.05,
            hz: 2.0,
            cycles: 2.0,
        };
        assert_eq!(shake.duration_s(), 1.0);
        let h = 1e-5;
        assert!(shake.offset(h).abs() < 1e-9 && shake.offset(1.0 - h).abs() < 1e-9);
        let peak = (0..1000)
            .map(|i| shake.offset(f64::from(i) / 1000.0).abs())
            .fold(0.0, f64::max);
        assert!(peak > 0.03 && peak <= 0.05, "{peak}");
    }
}
