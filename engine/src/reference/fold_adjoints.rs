//! `fold_adjoints`: A = dL/dV̂ / (W + ε) and H = dL/dW - A V̂, so that dL/dw = A c + H and dL/dc = A w.

use super::{Adjoint, Reconstruction};

/// The folded adjoint of one sample.
pub fn fold(got: Reconstruction, adjoint: Adjoint, epsilon: f64) -> Adjoint {
    let a = adjoint.value / (got.weight + epsilon);
    Adjoint { value: a, weight: adjoint.weight - a * got.value }
}
