//! How heavy is it, and how hard to turn? Exact volume integrals of a closed triangle mesh.
//!
//! The integrals are those of B. Mirtich, "Fast and accurate computation of polyhedral mass
//! properties", J. Graphics Tools 1(2), 1996, evaluated as signed tetrahedra with the canonical
//! covariance matrix of J. Blow and A. J. Binstock (2004), which is the same polynomial.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::mesh::TriMesh;

/// Mass, centre of mass and inertia of a solid, in the frame of its mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MassProperties {
    /// Enclosed volume, m3.
    pub volume_m3: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m, object frame.
    pub com_m: Point3<f64>,
    /// Inertia tensor about the centre of mass, kg m2, object axes. Off-diagonal elements carry
    /// the usual minus sign (`-integral(x y dm)`).
    pub inertia_kg_m2: Matrix3<f64>,
}

impl MassProperties {
    /// Properties of the solid enclosed by `mesh` at density 1 kg/m3.
    ///
    /// Only meaningful for a watertight mesh. The volume is zero or negative for an open or
    /// inside-out one; callers check.
    pub fn of_mesh(mesh: &TriMesh) -> Self {
        let (lo, hi) = mesh.bounds();
        let origin = nalgebra::center(&lo, &hi);
        // Covariance of the tetrahedron (0, e1, e2, e3): 1/60 on the diagonal, 1/120 off it.
        let canonical = Matrix3::from_fn(|i, j| if i == j { 1.0 / 60.0 } else { 1.0 / 120.0 });
        let mut volume = 0.0;
        let mut first = Vector3::zeros();
        let mut covariance = Matrix3::zeros();
        for i in 0..mesh.faces().len() {
            let [a, b, c] = mesh.triangle(i).map(|v| v - origin);
            let det = a.dot(&b.cross(&c));
            let corners = Matrix3::from_columns(&[a, b, c]);
            volume += det / 6.0;
            first += (a + b + c) * (det / 24.0);
            covariance += corners * canonical * corners.transpose() * det;
        }
        let com = first / volume;
        let central = covariance - com * com.transpose() * volume;
        Self {
            volume_m3: volume,
            mass_kg: volume,
            com_m: origin + com,
            inertia_kg_m2: Matrix3::from_diagonal_element(central.trace()) - central,
        }
    }

    /// The same solid with another mass, kg.
    pub fn with_mass(&self, mass_kg: f64) -> Self {
        Self {
            mass_kg,
            inertia_kg_m2: self.inertia_kg_m2 * (mass_kg / self.mass_kg),
            ..self.clone()
        }
    }

    /// The same solid with another density, kg/m3.
    pub fn with_density(&self, density_kg_m3: f64) -> Self {
        self.with_mass(density_kg_m3 * self.volume_m3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::RawMesh;
    use nalgebra::Rotation3;
    use std::path::Path;

    fn block(size: Vector3<f64>, rotation: Rotation3<f64>, shift: Vector3<f64>) -> TriMesh {
        let base = crate::shapes::loft::cuboid(size);
        let vertices = base
            .vertices
            .iter()
            .map(|v| (rotation * Vector3::from(*v) + shift).into())
            .collect();
        TriMesh::from_raw(
            RawMesh {
                vertices,
                faces: base.faces,
            },
            Path::new("block"),
        )
        .unwrap()
        .0
    }

    #[test]
    fn a_turned_and_shifted_block_has_the_textbook_tensor() {
        let size = Vector3::new(0.03, 0.05, 0.11);
        let rotation = Rotation3::from_euler_angles(0.3, -0.7, 1.1);
        let shift = Vector3::new(3.0, -2.0, 0.5);
        let m = MassProperties::of_mesh(&block(size, rotation, shift)).with_density(700.0);
        let mass = 700.0 * size.product();
        let s = size.component_mul(&size) * (mass / 12.0);
        let expected = rotation.matrix()
            * Matrix3::from_diagonal(&Vector3::new(s.y + s.z, s.x + s.z, s.x + s.y))
            * rotation.matrix().transpose();
        assert!((m.mass_kg - mass).abs() < 1e-12 * mass);
        assert!((m.com_m.coords - shift).norm() < 1e-12);
        assert!((m.inertia_kg_m2 - expected).norm() < 1e-9 * expected.norm());
    }
}
