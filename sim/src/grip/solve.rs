//! The velocities at the end of a substep: Newton's method on the eight coordinates.
//!
//! Pads are springs with damping, so that every force is a function of the velocity at the end of the
//! substep (implicit Euler): a point presses with `max(0, k (depth - h v) - c v)`, a patch holds with
//! its bristle up to friction times what its points press. With the limits of friction fixed these
//! forces have a convex potential (A. Castro et al., "An unconstrained convex formulation of compliant
//! contact", T-RO 2023, treats such contacts), so Newton's method with a check finds the one solution.

use nalgebra::{SMatrix, SVector};

use super::patch::{Patches, Point, Row};

pub(super) type Matrix8 = SMatrix<f64, 8, 8>;
pub(super) type Vector8 = SVector<f64, 8>;
type Factor = nalgebra::Cholesky<f64, nalgebra::Const<8>>;

/// Newton steps at most.
const ITERATIONS: usize = 20;
/// How often the limits of friction follow the pressure at most.
const ROUNDS: usize = 8;
/// Speed, m/s, below which a change of the solution does not matter.
const TOLERANCE_M_S: f64 = 1e-7;
/// Arm that makes a speed of an angular velocity, m.
const ARM_M: f64 = 0.05;

/// Material of the pads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pads {
    pub stiffness_n_m: f64,
    pub shear_stiffness_n_m: f64,
    pub relaxation_s: f64,
    pub friction: f64,
}

/// Solver with the factor of the last matrix, which often serves again.
#[derive(Debug)]
pub(super) struct Solver {
    factor: Option<Factor>,
    /// Which points press in the matrix of that factor.
    pressing: Vec<bool>,
}

impl Solver {
    pub fn new() -> Self {
        Self {
            factor: None,
            pressing: Vec::with_capacity(256),
        }
    }

    /// The geometry or the masses changed: the factor is of no use any more.
    pub fn forget(&mut self) {
        self.factor = None;
    }

    /// Solves `mass u = push + h sum of contact forces(u)` for the velocities `u`, starting from `u`.
    ///
    /// What limits friction is fixed while Newton's method runs; the potential is convex then, and a
    /// step that does not lower it is halved. Then the limits follow the pressure, until they agree.
    pub fn solve(
        &mut self,
        mass: &Matrix8,
        push: &Vector8,
        contacts: &mut Patches,
        pads: &Pads,
        h: f64,
        u: &mut Vector8,
    ) {
        if contacts.points.is_empty() {
            match mass.cholesky() {
                Some(factor) => *u = factor.solve(push),
                None => u.fill(f64::NAN),
            }
            return;
        }
        let problem = Problem {
            mass,
            push,
            pads,
            h,
            normal: pads.stiffness_n_m * (h + pads.relaxation_s),
            free: pads.stiffness_n_m * h,
            shear: pads.shear_stiffness_n_m * (h + pads.relaxation_s),
        };
        for round in 0..ROUNDS {
            let sliding = self.newton(&problem, contacts, u);
            let mut settled = true;
            for patch in &mut contacts.patches {
                let limit_n = pads.friction * patch.force_n(&contacts.points);
                let change = (limit_n - patch.limit_n).abs();
                let matters = sliding || patch.held_n > limit_n;
                settled &= !matters || change <= 1e-4 * limit_n + 1e-9;
                patch.limit_n = if round < 3 {
                    limit_n
                } else {
                    (limit_n + patch.limit_n) / 2.0
                };
            }
            if settled {
                break;
            }
        }
    }

    /// Finds the velocities under fixed limits of friction; says whether any patch slides.
    fn newton(&mut self, problem: &Problem, contacts: &mut Patches, u: &mut Vector8) -> bool {
        let mut now = problem.at(contacts, u);
        for _ in 0..ITERATIONS {
            if now.sliding || self.factor.is_none() || !self.fits(contacts) {
                self.factor = self.matrix(problem, contacts, now.sliding);
            }
            let Some(factor) = &self.factor else {
                // Only what is no number any more has no factor: the trial has diverged.
                u.fill(f64::NAN);
                return false;
            };
            let mut step = factor.solve(&now.slope);
            let size = speed(&step);
            let start = *u;
            let mut next;
            let mut halvings = 0;
            loop {
                *u = start - step;
                next = problem.at(contacts, u);
                let lower = next.potential <= now.potential + 1e-12 * now.potential.abs();
                if lower || size < 1e-5 || halvings == 6 {
                    break;
                }
                step *= 0.5;
                halvings += 1;
            }
            // While nothing slides and the same points press the equations are linear: solved.
            let linear = halvings == 0 && !now.sliding && !next.sliding && self.fits(contacts);
            now = next;
            if linear || size < TOLERANCE_M_S {
                break;
            }
        }
        now.sliding
    }

    /// Do the points press that pressed in the matrix of the factor?
    fn fits(&self, contacts: &Patches) -> bool {
        self.pressing.len() == contacts.points.len()
            && (self.pressing.iter().zip(&contacts.points))
                .all(|(was, point)| *was == (point.force_n > 0.0))
    }

    /// The second derivative of the potential, factored.
    fn matrix(&mut self, problem: &Problem, contacts: &Patches, sliding: bool) -> Option<Factor> {
        let h = problem.h;
        let mut matrix = *problem.mass;
        self.pressing.clear();
        for point in &contacts.points {
            let presses = point.force_n > 0.0;
            self.pressing.push(presses);
            if presses {
                add_square(&mut matrix, &point.row, h * problem.rate(point));
            }
        }
        for patch in contacts.patches.iter().filter(|p| p.limit_n > 0.0) {
            let weight = h * problem.shear;
            if patch.held_n <= patch.limit_n {
                for row in &patch.rows {
                    add_square(&mut matrix, row, weight);
                }
            } else {
                // Across the way it slides the limit acts like a spring, along it not at all.
                let weight = weight * patch.limit_n / patch.held_n;
                let mut along = [0.0; 8];
                for (row, w) in patch.rows.iter().zip(patch.wanted_n) {
                    add_square(&mut matrix, row, weight);
                    for (sum, r) in along.iter_mut().zip(row) {
                        *sum += r * w / patch.held_n;
                    }
                }
                add_square(&mut matrix, &along, -weight);
            }
        }
        if sliding {
            // Never serves again: the next one slides another way.
            self.pressing.clear();
        }
        matrix.cholesky()
    }
}

/// One substep's equations.
struct Problem<'a> {
    mass: &'a Matrix8,
    push: &'a Vector8,
    pads: &'a Pads,
    h: f64,
    /// Force by speed of a point that presses already; of one that only comes near; of a patch.
    normal: f64,
    free: f64,
    shear: f64,
}

/// Potential and slope at one velocity.
struct Value {
    potential: f64,
    slope: Vector8,
    sliding: bool,
}

impl Problem<'_> {
    /// A pad damps only what it touches.
    #[inline]
    fn rate(&self, point: &Point) -> f64 {
        if point.depth_m > 0.0 {
            self.normal
        } else {
            self.free
        }
    }

    /// Sets the forces at `u`, sums up potential and slope.
    fn at(&self, contacts: &mut Patches, u: &Vector8) -> Value {
        let h = self.h;
        let momentum = self.mass * u;
        let mut slope = momentum - self.push;
        let mut potential = u.dot(&(momentum * 0.5 - self.push));
        for point in &mut contacts.points {
            let rate = self.rate(point);
            let force_n = self.pads.stiffness_n_m * point.depth_m - rate * dot(&point.row, u);
            point.force_n = force_n.max(0.0);
            if force_n > 0.0 {
                add(&mut slope, &point.row, -h * force_n);
                potential += h * force_n * force_n / (2.0 * rate);
            }
        }
        let mut sliding = false;
        for patch in &mut contacts.patches {
            let limit_n = patch.limit_n;
            if limit_n <= 0.0 {
                patch.held_n = 0.0;
                continue;
            }
            let wanted: [f64; 3] = std::array::from_fn(|a| {
                self.pads.shear_stiffness_n_m * patch.bent_m[a]
                    + self.shear * dot(&patch.rows[a], u)
            });
            let size = norm(&wanted);
            patch.wanted_n = wanted;
            patch.held_n = size;
            let share = if size > limit_n {
                sliding = true;
                potential += h * limit_n * (size - limit_n / 2.0) / self.shear;
                limit_n / size
            } else {
                potential += h * size * size / (2.0 * self.shear);
                1.0
            };
            for (row, w) in patch.rows.iter().zip(wanted) {
                add(&mut slope, row, h * share * w);
            }
        }
        Value {
            potential,
            slope,
            sliding,
        }
    }
}

/// The largest speed in a step.
fn speed(step: &Vector8) -> f64 {
    let each = step.iter().enumerate();
    each.map(|(i, x)| if (3..6).contains(&i) { ARM_M * x } else { *x })
        .fold(0.0, |m, x| m.max(x.abs()))
}

#[inline]
pub(super) fn dot(row: &Row, u: &Vector8) -> f64 {
    row.iter().zip(u.iter()).map(|(a, b)| a * b).sum()
}

#[inline]
fn add(sum: &mut Vector8, row: &Row, factor: f64) {
    for (s, r) in sum.iter_mut().zip(row) {
        *s += factor * r;
    }
}

/// Adds to the lower triangle, which is all that a factor needs.
#[inline]
fn add_square(matrix: &mut Matrix8, row: &Row, factor: f64) {
    for (j, column) in matrix.as_mut_slice().chunks_exact_mut(8).enumerate() {
        let f = factor * row[j];
        for (m, r) in column[j..].iter_mut().zip(&row[j..]) {
            *m += f * r;
        }
    }
}

fn norm(v: &[f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
