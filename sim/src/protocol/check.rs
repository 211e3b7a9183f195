//! Which constants make sense?

use super::{LoadKind, Protocol};

impl Protocol {
    pub(super) fn check(&self) -> Result<(), String> {
        let s = &self.solver;
        let positive = [
            ("object_density_kg_m3", self.object_density_kg_m3),
            ("dt_s", self.dt_s),
            ("solver.fine_speed_m_s", self.solver.fine_speed_m_s),
            ("grip_force_n", self.grip_force_n),
            ("grip_force_per_kg_n", self.grip_force_per_kg_n),
            ("grip_force_safety", self.grip_force_safety),
            ("grip_force_min_n", self.grip_force_min_n),
            ("grip_force_max_n", self.grip_force_max_n),
            ("closing_speed_m_s", self.closing_speed_m_s),
            ("closing_time_s", self.closing_time_s),
            ("shake_linear_hz", self.shake_linear_hz),
            ("shake_angular_hz", self.shake_angular_hz),
            ("max_slip_m", self.max_slip_m),
            ("max_slip_rad", self.max_slip_rad),
            ("lost_contact_s", self.lost_contact_s),
            ("object_mass_kg", self.object_mass_kg),
            ("tug_time_s", self.tug_time_s),
            ("lift_speed_m_s", self.lift_speed_m_s),
            ("hardness_start_g", self.hardness_start_g),
            ("hardness_growth", self.hardness_growth),
            ("hardness_max_g", self.hardness_max_g),
            ("origin_distance_max_m", self.origin_distance_max_m),
            ("solver.pad_stiffness_n_m", s.pad_stiffness_n_m),
            ("solver.pad_shear_stiffness_n_m", s.pad_shear_stiffness_n_m),
            ("solver.contact_hz", s.contact_hz),
            ("solver.contact_damping_ratio", s.contact_damping_ratio),
            ("solver.patch_scale", s.patch_scale),
            ("solver.prediction_m", s.prediction_m),
            ("solver.corrective_speed_m_s", s.corrective_speed_m_s),
            ("solver.finger_mass_kg", s.finger_mass_kg),
            ("solver.piece_concavity", s.piece_concavity),
        ];
        for (key, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{key} is {value}; give a positive number"));
            }
        }
        let not_negative = [
            ("friction", self.friction),
            ("friction_scale", self.friction_scale),
            ("closing_friction_scale", self.closing_friction_scale),
            ("friction_torsional_m", self.friction_torsional_m),
            ("standoff_m", self.standoff_m),
            ("finger_edge_m", self.finger_edge_m),
            ("object_mass_min_kg", self.object_mass_min_kg),
            ("closing_force_n", self.closing_force_n),
            ("grip_ramp_s", self.grip_ramp_s),
            ("hold_stiffness_n_m", self.hold_stiffness_n_m),
            ("hold_damping_n_s_m", self.hold_damping_n_s_m),
            ("settle_s", self.settle_s),
            ("shake_axis_z_m", self.shake_axis_z_m),
            ("tug_force_n", self.tug_force_n),
            ("tug_acceleration_m_s2", self.tug_acceleration_m_s2),
            ("lift_height_m", self.lift_height_m),
            ("lift_rate_1_s", self.lift_rate_1_s),
            ("lift_time_s", self.lift_time_s),
            ("opening_min_m", self.opening_min_m),
            ("object_damping_1_s", self.object_damping_1_s),
            ("gravity_m_s2", self.gravity_m_s2),
            ("shake_linear_m", self.shake_linear_m),
            ("shake_linear_cycles", self.shake_linear_cycles),
            ("shake_angular_rad", self.shake_angular_rad),
            ("shake_angular_cycles", self.shake_angular_cycles),
            ("hold_s", self.hold_s),
            ("initial_penetration_max_m", self.initial_penetration_max_m),
            ("solver.coupling_hz", s.coupling_hz),
            ("solver.pad_relaxation_s", s.pad_relaxation_s),
            ("solver.contact_reuse_m", s.contact_reuse_m),
        ];
        for (key, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                return Err(format!("{key} is {value}; give a number >= 0"));
            }
        }
        if self.load == LoadKind::Tugs {
            if self.tug_directions.is_empty() {
                return Err("load = \"tugs\" needs at least one of tug_directions".into());
            }
            let zero = |d: &[f64; 3]| d.iter().map(|x| x * x).sum::<f64>() < 1e-12;
            if let Some(d) = self.tug_directions.iter().find(|d| zero(d)) {
                return Err(format!("tug_directions: {d:?} is no direction"));
            }
        }
        if self.hardness_growth <= 1.0 {
            return Err(format!(
                "hardness_growth is {}; levels grow only above 1",
                self.hardness_growth
            ));
        }
        if self.dt_s > 0.02 {
            return Err(format!(
                "dt_s is {}; steps over 0.02 s decide nothing",
                self.dt_s
            ));
        }
        if s.iterations == 0 || s.substeps == 0 || s.piece_resolution < 8 || s.piece_max == 0 {
            return Err(
                "solver.substeps, solver.iterations and solver.piece_max need at least 1, solver.piece_resolution 8"
                    .into(),
            );
        }
        Ok(())
    }
}
