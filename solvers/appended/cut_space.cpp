#include "solvers/appended/cut_space.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace spherecut::solvers {

namespace {

/// m, from a front to the farthest place that its functions come to.
double farthest_from_front(const NodeCloud& nodes, const Spheres& spheres, const CutSpaceOptions& options) {
  const double widest = *std::max_element(nodes.spacings.begin(), nodes.spacings.end());
  const double largest = *std::max_element(spheres.radii().begin(), spheres.radii().end());
  return options.front.radius * widest + largest + 2 * widest;
}

} // namespace

CutSpaceOptions steps_alone() {
  CutSpaceOptions options;
  options.front.radius = 0;
  options.steps_by_run = true;
  return options;
}

CutSpace::CutSpace(const SmallBoxes& boxes, const topology::Domain& domain, const NodeCloud& nodes,
                   const Spheres& spheres, const Material& material, CutSpaceOptions options)
    : boxes_(boxes), domain_(domain), nodes_(nodes), spheres_(spheres), material_(material), options_(options),
      cut_(boxes, domain), places_(cut_, domain, material, farthest_from_front(nodes, spheres, options)),
      twins_of_(nodes.positions.size()), groups_of_(nodes.positions.size()), group_weights_(nodes.positions.size()),
      faint_(nodes.positions.size()), local_(most_parts * static_cast<std::size_t>(boxes.size()), -1),
      connected_(nodes.positions.size(), -1) {}

// Step of a partly cut sphere at x and its gradient; `place` null: far from every front, where the step is the side.
double CutSpace::step(const FrontPlace* place, const Vector3& x, double length, Vector3& gradient) const {
  gradient.setZero();
  if (place == nullptr) {
    const auto sheet = incision_->closest(x, 1e300);
    return !sheet || sheet->normal.dot(x - sheet->point) >= 0 ? 1 : -1;
  }
  const double a = place->ahead, b = place->above, r = std::hypot(a, b), side = b >= 0 ? 1 : -1;
  // r - a without cancellation ahead of the front.
  const double squared = (a > 0 ? b * b / (r + a + 1e-300) : r - a) / (2 * length),
               t = std::sqrt(std::max(0.0, squared));
  if (t >= 1)
    return side;
  if (t > 0 && r > 0) {
    const double slope = side * 15 * (1 - squared) * (1 - squared) / (8 * 4 * length * t);
    gradient = slope * ((a / r - 1) * place->grad_ahead + b / r * place->grad_above);
  }
  return side * t * (15 - 10 * squared + 3 * squared * squared) / 8;
}

/// Nodes whose twins or steps may be others now: those of boxes that are others; those by which the cut, and with it
/// its front, has changed within twice their sphere; those with a step that lies elsewhere with respect to the front.
/// `all`: a step comes or goes with its run, and so does every one in a divided box.
std::set<int> CutSpace::concerned_nodes(const std::vector<char>& changed, const BoundingBox& region, bool all) const {
  std::set<int> concerned;
  for (int box = 0; box < boxes_.size(); ++box)
    if (changed[box] == 1) {
      const SmallBox& at = boxes_.boxes()[box];
      for (const int node : spheres_.candidates(at.centre))
        concerned.insert(node);
      for (int k = 0; k < 8; ++k)
        for (const int node : spheres_.candidates(
                 at.centre + at.half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1))))
          concerned.insert(node);
    }
  for (int node = 0; node < spheres_.size(); ++node) {
    const Vector3& x = spheres_.centres()[node];
    if ((x - region.lower.cwiseMax(x.cwiseMin(region.upper))).norm() < 2 * spheres_.radii()[node])
      concerned.insert(node);
  }
  for (const CutFunction& function : functions_)
    if (!function.is_front && function.twin.is_step &&
        std::any_of(function.twin.hidden.begin(), function.twin.hidden.end(),
                    [&](PartId part) { return changed[box_of(part)] != 0; }))
      concerned.insert(function.twin.node);
  if (all)
    for (int box = 0; box < boxes_.size(); ++box)
      if (cut_.is_divided(box))
        for (const int node : boxes_.cells()[boxes_.cell_of(box)].nodes)
          concerned.insert(node);
  return concerned;
}

/// Functions that there are to be, and which of them the ones before are.
struct CutSpace::Wanted {
  std::vector<CutFunction> twins;
  std::vector<FrontGroup> groups;
  std::vector<char> twin_taken, group_taken;
};

bool CutSpace::front_stays(CutFunction& old, const std::vector<char>& cell_changed, Wanted& wanted) const {
  for (std::size_t g = 0; g < wanted.groups.size(); ++g)
    if (wanted.group_taken[g] == 0 && wanted.groups[g] == old.group) {
      const std::vector<int> cells = cells_of(old);
      if (std::none_of(cells.begin(), cells.end(), [&](int cell) { return cell_changed[cell] != 0; })) {
        wanted.group_taken[g] = 1;
        old.group.run = wanted.groups[g].run;
        return true;
      }
    }
  return false;
}

/// A step by runs stays where its run is there still, which may have another number now.
bool CutSpace::twin_stays(CutFunction& old, const std::vector<char>& changed, const std::set<int>& concerned,
                          Wanted& wanted) {
  if (!concerned.contains(old.twin.node))
    return true;
  if (std::any_of(old.twin.hidden.begin(), old.twin.hidden.end(), [&](PartId part) {
        return changed[box_of(part)] == 1 || (old.twin.is_step && changed[box_of(part)] != 0);
      }))
    return false;
  const int run = old.twin.run < 0 ? old.twin.run : places_.run_now(old.twin.run);
  if (old.twin.run >= 0 && run < 0)
    return false;
  for (std::size_t w = 0; w < wanted.twins.size(); ++w) {
    const Twin& twin = wanted.twins[w].twin;
    if (wanted.twin_taken[w] == 0 && twin.node == old.twin.node && twin.is_step == old.twin.is_step &&
        twin.run == run && twin.step_at_node == old.twin.step_at_node && twin.hidden == old.twin.hidden) {
      wanted.twin_taken[w] = 1;
      old.twin.run = run;
      return true;
    }
  }
  return false;
}

CutSpace::Change CutSpace::update(std::shared_ptr<const topology::Incision> incision, const BoundingBox& region) {
  incision_ = std::move(incision);
  // Parts whose boxes (1), or whose places with respect to the front (2), are others now.
  std::vector<char> changed(boxes_.size(), 0);
  for (const int box : cut_.update(*incision_, region))
    changed[box] = 1;
  const int runs_before = functions_.empty() ? 0 : places_.runs().count();
  places_.follow(cut_, incision_, region, changed);
  std::vector<char> cell_changed(boxes_.cells().size(), 0);
  for (int box = 0; box < boxes_.size(); ++box)
    if (changed[box] != 0)
      cell_changed[boxes_.cell_of(box)] = 1;

  // Twins of spheres in reach of what has changed are found anew.
  const std::vector<char> was_curved = std::move(curved_);
  const auto any = [](const std::vector<char>& flags) {
    return std::any_of(flags.begin(), flags.end(), [](char is) { return is != 0; });
  };
  bool comes_with_run = places_.runs().count() != 1 || runs_before != 1; // by run: those may be numbered anew
  if (!options_.steps_by_run) {
    find_curved_front();
    comes_with_run = any(was_curved) || any(curved_);
  }
  const std::set<int> concerned = concerned_nodes(changed, region, comes_with_run);
  Wanted wanted;
  for (const int node : concerned)
    add_twins(node, wanted.twins);
  wanted.groups = front_groups(places_.runs(), nodes_, options_.front);
  wanted.twin_taken.assign(wanted.twins.size(), 0);
  wanted.group_taken.assign(wanted.groups.size(), 0);

  Change change;
  std::vector<CutFunction> next;
  for (int k = 0; k < std::ssize(functions_); ++k) {
    CutFunction& old = functions_[k];
    if (old.is_front ? front_stays(old, cell_changed, wanted) : twin_stays(old, changed, concerned, wanted)) {
      change.kept.push_back(k);
      next.push_back(std::move(old));
    }
  }
  const auto append = [&](CutFunction function) {
    function.id = next_id_++;
    next.push_back(std::move(function));
    ++change.added;
  };
  for (std::size_t w = 0; w < wanted.twins.size(); ++w)
    if (wanted.twin_taken[w] == 0)
      append(std::move(wanted.twins[w]));
  for (std::size_t g = 0; g < wanted.groups.size(); ++g)
    if (wanted.group_taken[g] == 0) {
      CutFunction function;
      function.is_front = true;
      function.group = std::move(wanted.groups[g]);
      append(std::move(function));
    }
  functions_ = std::move(next);
  list_by_node();
  return change;
}

/// Twins and groups of every node.
void CutSpace::list_by_node() {
  for (std::size_t j = 0; j < twins_of_.size(); ++j) {
    twins_of_[j].clear();
    groups_of_[j].clear();
    group_weights_[j].clear();
  }
  for (int k = 0; k < std::ssize(functions_); ++k) {
    const CutFunction& function = functions_[k];
    if (!function.is_front) {
      twins_of_[function.twin.node].push_back(k);
      continue;
    }
    for (std::size_t n = 0; n < function.group.nodes.size(); ++n) {
      groups_of_[function.group.nodes[n]].push_back(k);
      group_weights_[function.group.nodes[n]].push_back(function.group.weights[n]);
    }
  }
}

std::vector<int> CutSpace::cells_of(const CutFunction& function) const {
  if (!function.is_front) {
    const std::span<const int> cells = boxes_.cells_of_node(function.twin.node);
    return {cells.begin(), cells.end()};
  }
  std::vector<int> cells;
  std::vector<char> taken(boxes_.cells().size(), 0);
  for (const int node : function.group.nodes)
    for (const int cell : boxes_.cells_of_node(node))
      if (taken[cell] == 0) {
        taken[cell] = 1;
        cells.push_back(cell);
      }
  std::sort(cells.begin(), cells.end());
  return cells;
}

bool CutSpace::term_at(int k, PartId part, int sample, ScalarTerm& term) const {
  const Twin& twin = functions_[k].twin;
  const int box = box_of(part), lane = boxes_.lane_of(box);
  const BoxShapes& cell = boxes_.cells()[boxes_.cell_of(box)];
  const auto at = std::lower_bound(cell.nodes.begin(), cell.nodes.end(), twin.node);
  if (at == cell.nodes.end() || *at != twin.node)
    return false;
  const auto place = static_cast<std::size_t>(at - cell.nodes.begin());
  const Vector3 gradient = cell.gradient_at(place, lane);
  const double middle = cell.value_at(place, lane);
  if (!twin.is_step) {
    if (!std::binary_search(twin.hidden.begin(), twin.hidden.end(), part) || (middle == 0 && gradient.isZero(0)))
      return false;
    term = {k, middle, gradient};
    return true;
  }
  Vector3 slope;
  const auto jump = jump_at(twin, part, sample, slope);
  if (!jump)
    return false;
  const double value = middle + gradient.dot(places_.of(cut_, part)[sample].at - boxes_.boxes()[box].middle);
  term = {k, value * *jump, *jump * gradient + value * slope};
  return *jump != 0 || !slope.isZero(0);
}

/// psi of a step at a sample of a part, with its slope; of no value: the step does not reach the part.
std::optional<double> CutSpace::jump_at(const Twin& twin, PartId part, int sample, Vector3& slope) const {
  PlacedSample& placed = places_.of(cut_, part)[sample];
  const FrontPlace* at_front = placed.place ? &*placed.place : nullptr;
  if (twin.run >= 0) {
    if (!std::binary_search(twin.hidden.begin(), twin.hidden.end(), part))
      return std::nullopt;
    const PlaceAtRun* const at_run = places_.at_run(placed, twin.run);
    at_front = at_run != nullptr ? &at_run->place : nullptr;
  }
  const double jump = 0.5 * (step(at_front, placed.at, twin.step_length, slope) - twin.step_at_node);
  slope *= 0.5;
  return jump;
}

// A group whose blended hats are `value`, with their gradient, at a place.
FrontTerm CutSpace::front_term(int k, double value, const Vector3& gradient, PlaceAtRun& placed) const {
  const FrontStation& station = functions_[k].group.station;
  if (placed.station.spacing != station.spacing || placed.station.point != station.point ||
      placed.station.axes != station.axes) {
    placed.fields = front_fields(material_, station, placed.place, placed.tip);
    placed.station = station;
  }
  const FrontFields& fields = placed.fields;
  FrontTerm term{k, value * fields.value, {}};
  for (int mode = 0; mode < 3; ++mode)
    term.gradient[mode] = value * fields.gradient[mode] + fields.value.col(mode) * gradient.transpose();
  return term;
}

std::vector<int> CutSpace::cells_of_groups(int first) const {
  std::vector<char> taken(boxes_.cells().size(), 0);
  for (std::size_t node = 0; node < groups_of_.size(); ++node)
    if (std::any_of(groups_of_[node].begin(), groups_of_[node].end(), [&](int k) { return k >= first; }))
      for (const int cell : boxes_.cells_of_node(static_cast<int>(node)))
        taken[cell] = 1;
  std::vector<int> cells;
  for (int cell = 0; cell < std::ssize(taken); ++cell)
    if (taken[cell] != 0)
      cells.push_back(cell);
  return cells;
}

void CutSpace::take_out_faint(const Vector3& x, PartId part, ShapeFunctions& shape) const {
  take_out(spheres_, x, shape, [&](int k) {
    const std::vector<PartId>& faint = faint_[shape.nodes[k]];
    return !faint.empty() && std::binary_search(faint.begin(), faint.end(), part);
  });
}

void CutSpace::terms_at(const Vector3& x, PartId part, const ShapeFunctions& shape, CutTerms& terms) const {
  terms.clear();
  if (functions_.empty())
    return;
  constexpr int nearest = -1;
  std::map<int, std::optional<FrontPlace>> placed; // of x, by run of the front; few
  const auto place_at = [&](int run) -> const FrontPlace* {
    auto found = placed.find(run);
    if (found == placed.end())
      found = placed.emplace(run, run == nearest ? places_.nearest(x) : places_.of_run(x, run)).first;
    return found->second ? &*found->second : nullptr;
  };
  std::map<int, std::pair<double, Vector3>> of_group; // few
  for (int n = 0; n < shape.size(); ++n) {
    const int node = shape.nodes[n];
    for (const int k : twins_of_[node]) {
      const Twin& twin = functions_[k].twin;
      if (!twin.is_step) {
        if (std::binary_search(twin.hidden.begin(), twin.hidden.end(), part))
          terms.scalar.push_back({k, shape.value[n], shape.gradient(n)});
        continue;
      }
      if (twin.run >= 0 && !std::binary_search(twin.hidden.begin(), twin.hidden.end(), part))
        continue;
      Vector3 slope;
      const double jump =
          0.5 * (step(place_at(twin.run >= 0 ? twin.run : nearest), x, twin.step_length, slope) - twin.step_at_node);
      if (jump != 0 || !slope.isZero(0))
        terms.scalar.push_back({k, shape.value[n] * jump, jump * shape.gradient(n) + 0.5 * shape.value[n] * slope});
    }
    for (std::size_t g = 0; g < groups_of_[node].size(); ++g) {
      auto& [value, gradient] = of_group.try_emplace(groups_of_[node][g], 0, Vector3::Zero()).first->second;
      value += group_weights_[node][g] * shape.value[n];
      gradient += group_weights_[node][g] * shape.gradient(n);
    }
  }
  if (of_group.empty() || place_at(nearest) == nullptr)
    return;
  PlacedSample here{1, x, placed.at(nearest), {}};
  for (const auto& [k, sum] : of_group)
    if (PlaceAtRun* const at = places_.at_run(here, functions_[k].group.run); at != nullptr)
      terms.front.push_back(front_term(k, sum.first, sum.second, *at));
}

} // namespace spherecut::solvers
