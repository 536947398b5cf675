#include "solvers/appended/kept_places.hpp"

#include "solvers/algebra/dense_products.hpp"

#include <algorithm>
#include <map>

namespace spherecut::solvers {

namespace {

// In spacings. A share changes where its points see other nodes, or where the points of a face near a front lie closer.
constexpr double share_reach = 4;
constexpr double point_reach = 3; // points of a share lie this near to its node

} // namespace

bool KeptPlaces::is_carried(const CutFunctional& functional) const {
  return std::any_of(functional.base.begin(), functional.base.end(),
                     [&](const auto& term) { return carried_[term.first] != 0; });
}

void KeptPlaces::follow(const Problem& problem, const BoundingBox& region, const CutSpace::Change& change,
                        IsDropped is_dropped) {
  const bool had_dropped = static_cast<bool>(is_dropped_);
  problem_ = &problem;
  is_dropped_ = std::move(is_dropped);
  const std::vector<char> before = std::move(carried_now_);
  carried_now_.assign(static_cast<std::size_t>(uncut_.size()), 0);
  for (const CutFunction& function : space_->functions())
    if (function.is_front)
      for (const int node : function.group.nodes)
        carried_now_[node] = 1;
    else
      carried_now_[function.twin.node] = 1;
  carried_ = carried_now_;
  for (std::size_t i = 0; i < before.size(); ++i)
    carried_[i] |= before[i];
  const bool all_anew = had_dropped || is_dropped_ || touched_from_ != problem.touched_from ||
                        (change.kept.empty() && change.added == 0 && before.empty());
  touched_from_ = problem.touched_from;
  if (all_anew) {
    contacts_.clear();
    nodal_.clear();
  }
  const NodeCloud& nodes = problem.nodes;
  std::erase_if(contacts_, [&](const auto& known) {
    const int node = known.first;
    const Vector3& x = nodes.positions[node];
    return (x - region.lower.cwiseMax(x.cwiseMin(region.upper))).norm() < share_reach * nodes.spacings[node];
  });
  for (auto& [node, contact] : contacts_)
    contact.is_current = contact.is_current && !is_carried(contact.mean);
  nodal_.resize(static_cast<std::size_t>(nodes.size()));
  for (std::optional<CutFunctional>& value : nodal_)
    if (value && is_carried(*value))
      value.reset();
  std::erase_if(halves_, [](const auto& half) { return !half.second.used; });
  for (auto& [node, half] : halves_)
    half.used = false;
}

CutFunctional KeptPlaces::mean_over(std::vector<QuadraturePoint> points) const {
  if (is_dropped_)
    std::erase_if(points, [&](const QuadraturePoint& point) { return is_dropped_(point.position); });
  return system_->mean_over(points);
}

void KeptPlaces::require(const std::vector<int>& wanted) {
  std::vector<int> missing;
  for (const int node : wanted) {
    const auto known = contacts_.find(node);
    if (known == contacts_.end()) {
      missing.push_back(node);
    } else if (!known->second.is_current) {
      known->second.mean = mean_over(known->second.share);
      known->second.is_current = true;
    }
  }
  if (missing.empty())
    return;
  const NodeCloud& nodes = problem_->nodes;
  BoundingBox part{Vector3::Constant(1e300), Vector3::Constant(-1e300)};
  bool all_lips = true;
  for (const int node : missing) {
    const Vector3& x = nodes.positions[node];
    const double reach = point_reach * nodes.spacings[node];
    part.lower = part.lower.cwiseMin(Vector3(x.array() - reach));
    part.upper = part.upper.cwiseMax(Vector3(x.array() + reach));
    all_lips = all_lips && nodes.kinds[node] == NodeKind::lip;
  }
  const SurfacePatches patches(*problem_->domain, nodes, problem_->incision, part,
                               all_lips ? SurfacePatches::Of::faces : SurfacePatches::Of::skin_and_faces);
  for (const int node : missing) {
    DisplacementMean mean = patches.contact_mean(node, uncut_.spheres(), *problem_);
    contacts_.insert_or_assign(node, Contact{mean_over(mean.share), mean.centroid, std::move(mean.share), true});
  }
}

const KeptPlaces::Contact& KeptPlaces::contact(int node) {
  const auto known = contacts_.find(node);
  if (known != contacts_.end() && known->second.is_current)
    return known->second;
  require({node});
  return contacts_.at(node);
}

const CutFunctional& KeptPlaces::at_node(int node) {
  std::optional<CutFunctional>& value = nodal_[static_cast<std::size_t>(node)];
  if (!value)
    value = mean_over({{problem_->nodes.positions[node], 1}});
  return *value;
}

// The half solutions of the uncut body to unit forces on the nodes.
void KeptPlaces::require_halves(const std::vector<int>& nodes) {
  require(nodes);
  std::vector<int> missing;
  for (const int node : nodes) {
    const auto known = halves_.find(node);
    if (known == halves_.end() || known->second.of != contacts_.at(node).mean.base)
      missing.push_back(node);
    else
      known->second.used = true;
  }
  std::sort(missing.begin(), missing.end());
  missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
  if (missing.empty())
    return;
  MatrixX loads = MatrixX::Zero(3 * static_cast<Eigen::Index>(uncut_.size()), 3 * std::ssize(missing));
  for (Eigen::Index k = 0; k < std::ssize(missing); ++k)
    for (const auto& [node, weight] : contacts_.at(missing[k]).mean.base)
      for (int axis = 0; axis < 3; ++axis)
        loads(3 * static_cast<Eigen::Index>(uncut_.rank()[node]) + axis, 3 * k + axis) = weight;
  const MatrixX solved = uncut_.factor().forward_sparse(loads);
  for (Eigen::Index k = 0; k < std::ssize(missing); ++k)
    halves_.insert_or_assign(missing[k],
                             Half{contacts_.at(missing[k]).mean.base, solved.middleCols<3>(3 * k), ++version_, true});
}

MatrixX KeptPlaces::base_halves(const std::vector<int>& nodes) {
  require_halves(nodes);
  MatrixX base(3 * static_cast<Eigen::Index>(uncut_.size()), 3 * std::ssize(nodes));
  for (Eigen::Index k = 0; k < std::ssize(nodes); ++k)
    base.middleCols<3>(3 * k) = halves_.at(nodes[k]).base;
  return base;
}

CutVectors KeptPlaces::unit_halves(const std::vector<int>& nodes) {
  CutVectors halves = system_->zero(3 * std::ssize(nodes));
  halves.base = base_halves(nodes);
  for (Eigen::Index k = 0; k < std::ssize(nodes); ++k)
    for (const auto& [function, matrix] : contacts_.at(nodes[k]).mean.cut)
      halves.cut.block<3, 3>(3 * static_cast<Eigen::Index>(function), 3 * k) = matrix.transpose();
  system_->finish_halves(halves);
  return halves;
}

MatrixX KeptPlaces::compliance(const std::vector<int>& nodes) {
  CutVectors halves = unit_halves(nodes);
  // Products of the uncut body's half solutions are kept, too.
  const auto count = std::ssize(nodes);
  std::map<std::pair<int, int>, Eigen::Index> before;
  for (Eigen::Index k = 0; k < std::ssize(gram_of_); ++k)
    before[gram_of_[k]] = k;
  std::vector<std::pair<int, int>> now;
  std::vector<Eigen::Index> place;
  std::vector<Eigen::Index> fresh;
  now.reserve(nodes.size());
  place.reserve(nodes.size());
  for (Eigen::Index k = 0; k < count; ++k) {
    now.emplace_back(nodes[k], halves_.at(nodes[k]).version);
    const auto at = before.find(now.back());
    place.push_back(at == before.end() ? -1 : at->second);
    if (at == before.end())
      fresh.push_back(k);
  }
  MatrixX products(3 * count, 3 * count);
  for (Eigen::Index b = 0; b < count; ++b)
    for (Eigen::Index a = 0; a < count; ++a)
      if (place[a] >= 0 && place[b] >= 0)
        products.block<3, 3>(3 * a, 3 * b) = gram_.block<3, 3>(3 * place[a], 3 * place[b]);
  if (!fresh.empty()) {
    MatrixX columns(halves.base.rows(), 3 * std::ssize(fresh));
    for (Eigen::Index k = 0; k < std::ssize(fresh); ++k)
      columns.middleCols<3>(3 * k) = halves.base.middleCols<3>(3 * fresh[k]);
    MatrixX with = MatrixX::Zero(3 * count, columns.cols());
    add_product(1, halves.base, true, columns, with);
    for (Eigen::Index k = 0; k < std::ssize(fresh); ++k) {
      products.middleCols<3>(3 * fresh[k]) = with.middleCols<3>(3 * k);
      products.middleRows<3>(3 * fresh[k]) = with.middleCols<3>(3 * k).transpose();
    }
  }
  gram_ = products;
  gram_of_ = std::move(now);
  add_product(1, halves.cut, true, halves.cut, products);
  if (halves.multipliers.rows() > 0)
    add_product(-1, halves.multipliers, true, halves.multipliers, products);
  return products;
}

} // namespace spherecut::solvers
