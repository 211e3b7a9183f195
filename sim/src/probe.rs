//! A gripped object under a load of one's own: for laws of physics and other questions that no
//! protocol asks.

use nalgebra::{Isometry3, Vector3};

use crate::scene::Scene;
use crate::world::{Drive, FingerContact, FingerState, ObjectLoad, World, world};

/// A trial that the caller steps.
pub struct Probe<'a> {
    scene: &'a Scene,
    world: Box<dyn World>,
    start: Isometry3<f64>,
}

impl<'a> Probe<'a> {
    /// The hand stands at `object_from_hand`, open by `opening_m`, nothing has moved.
    pub fn new(scene: &'a Scene, object_from_hand: &Isometry3<f64>, opening_m: f64) -> Self {
        let world = world(scene, object_from_hand, opening_m);
        let start = world.hand_from_body().expect("starts at finite poses");
        Self {
            scene,
            world,
            start,
        }
    }

    /// Closes the fingers for `duration_s` with the protocol's speed and force, then takes the
    /// object's damping away and switches gravity (m/s2, axes of the hand) on. Motion counts from
    /// here.
    pub fn close(&mut self, duration_s: f64, gravity_m_s2: &Vector3<f64>) {
        let p = &self.scene.protocol;
        self.world
            .limit_speed(self.scene, self.scene.grip_force_n, p.closing_speed_m_s);
        for _ in 0..(duration_s / p.dt_s).round() as u32 {
            self.step(&Isometry3::identity(), &ObjectLoad::default());
        }
        self.world.limit_speed(self.scene, 0.0, 1.0);
        self.world.release(gravity_m_s2, self.scene.friction);
        self.start = self.world.hand_from_body().unwrap_or(self.start);
    }

    /// One time step; the pose is that of the hand in its own frame at the start.
    pub fn step(&mut self, start_from_hand: &Isometry3<f64>, load: &ObjectLoad) {
        let drive = Drive {
            force_n: self.scene.grip_force_n,
            hold: None,
        };
        self.world.step(self.scene, start_from_hand, &drive, load);
    }

    /// Opens the hand at once and for good: nothing holds the object any more.
    pub fn remove_hand(&mut self) {
        self.world.remove_hand();
    }

    /// Motion of the centre of mass since [`Probe::close`], metres, and of the orientation (scaled
    /// axis, radians), both in the hand's axes. Not a number once it diverged.
    pub fn motion(&self) -> (Vector3<f64>, Vector3<f64>) {
        let Some(now) = self.world.hand_from_body() else {
            let nan = Vector3::repeat(f64::NAN);
            return (nan, nan);
        };
        (
            now.translation.vector - self.start.translation.vector,
            (now.rotation * self.start.rotation.inverse()).scaled_axis(),
        )
    }

    /// Momentum, kg m/s, and angular momentum about the centre of mass, kg m2/s, in world axes.
    pub fn momentum(&self) -> (Vector3<f64>, Vector3<f64>) {
        self.world.momentum(self.scene)
    }

    /// Contact of the left and the right finger in the last step.
    pub fn contacts(&self) -> [FingerContact; 2] {
        self.world.contacts()
    }

    /// Where the fingers are.
    pub fn fingers(&self) -> FingerState {
        self.world.fingers()
    }
}
