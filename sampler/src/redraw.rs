//! Where does a grasp begin that is drawn anew?

use crate::flow::FlowSample;

/// So often a grasp is drawn anew in the same place, however bad it looks.
const REDRAWS_IN_PLACE: usize = 31;

/// A place is left if after that nothing there scores as much.
const HOPELESS_SCORE: f32 = 0.1;

/// The best of a grasp's attempts so far.
pub(crate) struct Drawn {
    pub sample: FlowSample,
    pub score: f32,
    /// The attempt that its place was drawn for.
    pub place: usize,
}

impl Drawn {
    /// Where the next attempt begins: in the same place, turned another way, so that places that were spread
    /// evenly stay so; elsewhere once a place looks hopeless.
    pub fn next_place(&self, attempt: usize) -> usize {
        if attempt > REDRAWS_IN_PLACE && self.score < HOPELESS_SCORE {
            attempt
        } else {
            self.place
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn a_place_is_left_late_and_only_if_it_is_hopeless() {
        let next = |score, attempt| {
            let sample = FlowSample {
                rotation: UnitQuaternion::identity(),
                translation: Vector3::zeros(),
            };
            let place = 5;
            let drawn = Drawn {
                sample,
                score,
                place,
            };
            drawn.next_place(attempt)
        };
        assert_eq!(next(0.0, REDRAWS_IN_PLACE), 5);
        assert_eq!(next(0.0, REDRAWS_IN_PLACE + 1), REDRAWS_IN_PLACE + 1);
        assert_eq!(next(HOPELESS_SCORE, REDRAWS_IN_PLACE + 1), 5);
    }
}
