//! One object more from an object: the same shape stretched linearly.

use nalgebra::{Matrix3, UnitQuaternion};

use crate::mass::MassProperties;
use crate::object::Object;
use crate::surface::Surface;

impl Object {
    /// The object under the linear map `stretch` (about the origin of the object frame), of the
    /// same density.
    ///
    /// The inertia tensor follows from the covariance of the mass: `C -> S C S^T det S` at constant
    /// density, `I = tr(C) 1 - C`.
    ///
    /// # Panics
    /// If `stretch` mirrors or flattens.
    pub fn stretched(&self, id: &str, stretch: &Matrix3<f64>) -> Self {
        let growth = stretch.determinant();
        assert!(growth > 0.0, "a stretch keeps the orientation");
        let mesh = self.surface.mesh().mapped(stretch);
        let inertia = self.mass.inertia_kg_m2;
        let covariance = Matrix3::from_diagonal_element(inertia.trace() / 2.0) - inertia;
        let covariance = stretch * covariance * stretch.transpose() * growth;
        let mass = MassProperties {
            volume_m3: self.mass.volume_m3 * growth,
            mass_kg: self.mass.mass_kg * growth,
            com_m: stretch * self.mass.com_m,
            inertia_kg_m2: Matrix3::from_diagonal_element(covariance.trace()) - covariance,
        };
        Self {
            id: id.to_owned(),
            hash: mesh.content_hash(),
            surface: Surface::new(mesh, self.surface.is_watertight()),
            mass,
            has_own_mass: self.has_own_mass,
            friction: self.friction,
            report: self.report.clone(),
        }
    }

    /// The object turned about the origin of its frame, under its own name.
    pub fn turned(&self, turn: &UnitQuaternion<f64>) -> Self {
        self.stretched(&self.id, &turn.to_rotation_matrix().into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{Family, Split};

    #[test]
    fn a_stretched_object_weighs_what_its_own_mesh_weighs() {
        let object = Family::Mug
            .variant(Split::Seen, 0, 0)
            .object()
            .expect("a mug");
        let stretch = Matrix3::new(1.2, 0.1, 0.0, 0.05, 0.8, -0.1, 0.0, 0.2, 1.1);
        let copy = object.stretched("copy", &stretch);
        let density = object.mass.mass_kg / object.mass.volume_m3;
        let direct = MassProperties::of_mesh(copy.surface.mesh()).with_density(density);
        assert!((copy.mass.mass_kg / direct.mass_kg - 1.0).abs() < 1e-9);
        assert!((copy.mass.com_m - direct.com_m).norm() < 1e-9);
        let error = (copy.mass.inertia_kg_m2 - direct.inertia_kg_m2).norm();
        assert!(error < 1e-9 * direct.inertia_kg_m2.norm());
    }
}
