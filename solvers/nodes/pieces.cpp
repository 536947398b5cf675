// Which nodes of a cut body belong to one piece, and whether each piece has enough of them.
#include "solvers/nodes/samples.hpp"
#include "topology/search/disjoint_sets.hpp"
#include "topology/search/point_tree.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace spherecut::solvers {

namespace {

constexpr double sight = 2;       // in units of the mean spacing of two nodes
constexpr double flatness = 0.05; // in units of the mean spacing of a piece

} // namespace

std::vector<int> node_pieces(const NodeCloud& nodes, const topology::Incision& incision) {
  const int count = nodes.size();
  topology::DisjointSets joined(count);
  const topology::PointTree tree(nodes.positions);
  std::vector<topology::PointTree::Found> found;
  int pieces_left = count;
  for (int i = 0; i < count && pieces_left > 1; ++i) {
    const Vector3& x = nodes.positions[i];
    const double reach = sight * nodes.spacings[i];
    const bool sheets_near = incision.near(x, reach);
    found.clear();
    tree.within(x, reach, found); // of two nodes the coarser one finds the other
    for (const auto& [squared, j] : found) {
      const double limit = 0.5 * sight * (nodes.spacings[i] + nodes.spacings[j]);
      if (joined.find(i) != joined.find(j) && squared < limit * limit &&
          (!sheets_near || !incision.blocks(x, nodes.positions[j])) && joined.join(i, j))
        --pieces_left;
    }
  }
  std::vector<int> size(count, 0), roots;
  for (int i = 0; i < count; ++i) {
    ++size[joined.find(i)];
    if (joined.find(i) == i)
      roots.push_back(i);
  }
  std::stable_sort(roots.begin(), roots.end(), [&](int a, int b) { return size[a] > size[b]; });
  std::vector<int> number(count, -1), pieces(count);
  for (int p = 0; p < std::ssize(roots); ++p)
    number[roots[p]] = p;
  for (int i = 0; i < count; ++i)
    pieces[i] = number[joined.find(i)];
  return pieces;
}

std::vector<SprinklePiece> inspect_pieces(const NodeCloud& nodes, const topology::Incision& incision) {
  const std::vector<int> piece_of = node_pieces(nodes, incision);
  const int count = piece_of.empty() ? 0 : *std::max_element(piece_of.begin(), piece_of.end()) + 1;
  std::vector<SprinklePiece> pieces(count);
  std::vector<double> spacing(count, 0);
  for (int i = 0; i < nodes.size(); ++i) {
    ++pieces[piece_of[i]].nodes;
    pieces[piece_of[i]].centroid += nodes.positions[i];
    spacing[piece_of[i]] += nodes.spacings[i];
  }
  std::vector<Matrix3> moments(count, Matrix3::Zero());
  for (int p = 0; p < count; ++p) {
    pieces[p].centroid /= pieces[p].nodes;
    spacing[p] /= pieces[p].nodes;
  }
  for (int i = 0; i < nodes.size(); ++i) {
    const Vector3 arm = nodes.positions[i] - pieces[piece_of[i]].centroid;
    moments[piece_of[i]] += arm * arm.transpose();
  }
  for (int p = 0; p < count; ++p) {
    const Eigen::SelfAdjointEigenSolver<Matrix3> axes(moments[p] / pieces[p].nodes, Eigen::EigenvaluesOnly);
    pieces[p].flat = pieces[p].nodes < 4 || std::sqrt(std::max(axes.eigenvalues()[0], 0.0)) < flatness * spacing[p];
  }
  return pieces;
}

} // namespace spherecut::solvers
