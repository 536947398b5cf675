// What touches a body at finite strain, as the preconditioner of its equilibrium sees it: springs along single
// directions, passed to the rest operator by their condensed compliance (Woodbury's formula).
#pragma once

#include "solvers/finite/rest_operator.hpp"

#include <map>

namespace spherecut::solvers {

struct ActiveConstraint {
  int key = 0;                            // of its mean, the same whenever it is active
  const DisplacementMean* mean = nullptr; // of the body; outlives this
  Vector3 direction = Vector3::Zero();    // along which the mean is sprung
  double stiffness = 0;                   // N/m
};

/// K^-1 of unit forces on the means of constraints, by key: three columns each, m/N.
using ConstraintResponses = std::map<int, MatrixX>;

/// Finds those of `means`, by the key in `keys`, that `responses` lacks.
void find_responses(const RestOperator& rest, const std::vector<int>& keys,
                    const std::vector<const DisplacementMean*>& means, ConstraintResponses& responses);

/// Mean of the three columns of a response over the nodes of `mean`, m/N.
Matrix3 mean_response(const DisplacementMean& mean, const MatrixX& response);

/// Those of one mean stand together. Turns y = K^-1 q into (K + M^T D M)^-1 q, M the means along their directions and D
/// their stiffness. `responses` keeps what is found anew.
void correct(const RestOperator& rest, const std::vector<ActiveConstraint>& constraints, ConstraintResponses& responses,
             VectorX& y);

} // namespace spherecut::solvers
