// Derivatives of displacement fields by central differences of fourth order, to check formulas against the equations
// of linear elasticity.
#pragma once

#include "solvers/elasticity/material.hpp"
#include "topology/base/types.hpp"

#include <functional>

namespace spherecut::tests {

using VectorField = std::function<Vector3(const Vector3&)>;

/// Gradient du_i/dx_j with step h (m).
Matrix3 gradient(const VectorField& u, const Vector3& x, double h);

/// Hooke's law, Pa.
Matrix3 stress(const solvers::Material& material, const Matrix3& displacement_gradient);

/// Divergence of the stress of u, N/m3: minus the body force in equilibrium.
Vector3 stress_divergence(const solvers::Material& material, const VectorField& u, const Vector3& x, double h);

} // namespace spherecut::tests
