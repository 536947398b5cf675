// The stiffness of the weak form as a sparse matrix in elimination order, from the pairs of nodes that couple.
#pragma once

#include "solvers/algebra/factorisation.hpp"
#include "solvers/algebra/large_pages.hpp"
#include "solvers/body/discretisation.hpp"
#include "solvers/body/pieces.hpp"
#include "solvers/galerkin/stiffness_tiles.hpp"

namespace spherecut::solvers {

using EntriesInLargePages = std::vector<double, InLargePages<double>>;

/// Writes the lower triangle (diagonal blocks full) of the matrix of `pairs`, N/m, node i at rows 3 rank[i] to
/// 3 rank[i] + 2. `dropped`: nodes whose unknowns are taken out, empty when there are none; they keep a diagonal of
/// their own. `anchors` are added as springs E h. `elastic` gets the entries without the penalties of the held means.
/// Throws InputError where there are more entries than the factorisation can index.
void build_stiffness(std::vector<StiffnessTiles::Pair> pairs, const std::vector<int>& rank,
                     const std::vector<char>& dropped, const std::vector<Anchor>& anchors, const Problem& problem,
                     SparseMatrix& stiffness, EntriesInLargePages& elastic);

} // namespace spherecut::solvers
