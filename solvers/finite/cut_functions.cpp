#include "solvers/finite/cut_functions.hpp"

#include "solvers/body/elastic_body.hpp"
#include "topology/search/disjoint_sets.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace spherecut::solvers {

namespace {

constexpr double faint = 1e-5; // of the energy of its sphere: a step with less is none
constexpr double box_cell = 1; // edge of a background cell in spacings; it has 2 x 2 x 2 small boxes

NodeCloud first_nodes(NodeCloud nodes, int base) {
  nodes.positions.resize(base);
  nodes.spacings.resize(base);
  nodes.reaches.resize(base);
  nodes.kinds.resize(base);
  nodes.normals.resize(base);
  return nodes;
}

BoundingBox everywhere(const topology::Domain& domain) {
  const BoundingBox box = domain.bounds();
  const Vector3 margin = 0.01 * box.extent();
  return {box.lower - margin, box.upper + margin};
}

bool has_part(const Twin& twin, PartId part) {
  return std::binary_search(twin.hidden.begin(), twin.hidden.end(), part);
}

/// A step's function beyond the sheet, and its gradient, from those of its sphere and from the term of the space, which
/// is h (step - step at the node) / 2.
struct BeyondStep {
  double side, at_node;
  explicit BeyondStep(const Twin& twin) : side(twin.step_at_node >= 0 ? 1 : -1), at_node(twin.step_at_node) {}
  template <class Value>
  [[nodiscard]] Value of(const Value& whole, const Value& term) const {
    return 0.5 * (1 - side * at_node) * whole - side * term;
  }
};

} // namespace

UncutFunctions::UncutFunctions(const Problem& problem, int base, double support_radius, bool is_consistent)
    : domain_(problem.domain), nodes_(first_nodes(problem.nodes, base)), support_radius_(support_radius),
      is_consistent_(is_consistent),
      spheres_(nodes_.positions, nodes_.spacings, support_radius, Basis::linear, worst_moment_condition),
      boxes_(*domain_, nodes_, spheres_, box_cell), patches_(*domain_, nodes_) {
  if (!is_consistent)
    return;
  Problem uncut = problem;
  uncut.incision = nullptr;
  uncut.nodes = nodes_;
  BackgroundCells cells;
  // Nothing is divided: a group of the table is a cell of the boxes, in the order of their places.
  PointTable table =
      CutFunctions(std::shared_ptr<const UncutFunctions>(std::shared_ptr<void>(), this), uncut).tabulate(cells);
  consistency_ = make_consistent(nodes_.positions, surface_integrals(spheres_, patches_.points()), table);
  for (int group = 0; group < table.groups(); ++group) {
    const int cell = boxes_.cells_by_place()[group];
    const std::vector<int>& nodes = boxes_.cells()[cell].nodes;
    for (int slot = table.start[group]; slot < table.start[group + 1]; ++slot) {
      const auto k = std::lower_bound(nodes.begin(), nodes.end(), table.nodes[slot]) - nodes.begin();
      for (int lane = 0; lane < table.count[group]; ++lane)
        boxes_.set_gradient(cell, k, lane, table.gradient(slot, lane));
    }
  }
}

bool UncutFunctions::fits(const Problem& problem, int base, double support_radius, bool is_consistent) const {
  if (base != size() || problem.domain != domain_ || support_radius != support_radius_ ||
      is_consistent != is_consistent_)
    return false;
  for (int i = 0; i < base; ++i)
    if (nodes_.positions[i] != problem.nodes.positions[i] || nodes_.spacings[i] != problem.nodes.spacings[i] ||
        nodes_.kinds[i] != problem.nodes.kinds[i])
      return false;
  return true;
}

CutFunctions::CutFunctions(std::shared_ptr<const UncutFunctions> uncut, const Problem& problem)
    : uncut_(std::move(uncut)),
      space_(uncut_->boxes(), *problem.domain, uncut_->nodes(), uncut_->spheres(), problem.material, steps_alone()),
      of_node_(static_cast<std::size_t>(uncut_->size())), in_cell_(uncut_->boxes().cells().size()) {
  if (problem.incision == nullptr)
    return;
  space_.update(problem.incision, everywhere(*problem.domain));
  find_kept();
}

// A step that its sphere hardly feels, at its rim, would be an unknown without stiffness.
void CutFunctions::find_kept() {
  kept_.resize(space_.functions().size());
  std::iota(kept_.begin(), kept_.end(), 0);
  list_by_place();
  std::vector<double> whole(kept_.size(), 0), beyond(kept_.size(), 0);
  const SmallBoxes& boxes = uncut_->boxes();
  for (int cell = 0; cell < std::ssize(in_cell_); ++cell) {
    if (!has_step(cell))
      continue;
    const BoxShapes& shapes = boxes.cells()[cell];
    for (const Place& place : places_in(cell))
      for (const int f : in_cell_[cell]) {
        if (!twin(f).is_step)
          continue;
        const auto at = std::lower_bound(shapes.nodes.begin(), shapes.nodes.end(), twin(f).node);
        const Vector3 gradient = shapes.gradient_at(at - shapes.nodes.begin(), boxes.lane_of(box_of(place.part)));
        whole[f] += place.point.weight * gradient.squaredNorm();
        beyond[f] += place.point.weight * gradient_beyond(f, place, gradient).squaredNorm();
      }
  }
  std::vector<int> weighing;
  for (int f = 0; f < appended(); ++f)
    if (!twin(f).is_step || beyond[f] > faint * whole[f])
      weighing.push_back(kept_[f]);
  if (weighing.size() != kept_.size()) {
    kept_ = std::move(weighing);
    list_by_place();
  }
  find_hosts();
}

void CutFunctions::find_hosts() {
  host_.assign(kept_.size(), -1);
  for (int f = 0; f < appended(); ++f)
    if (twin(f).is_step)
      for (const int other : of_node_[twin(f).node])
        if (!twin(other).is_step && twin(other).hidden == twin(f).hidden)
          host_[f] = other;
}

void CutFunctions::list_by_place() {
  for (std::vector<std::vector<int>>* lists : {&of_node_, &in_cell_})
    for (std::vector<int>& list : *lists)
      list.clear();
  for (int f = 0; f < appended(); ++f) {
    of_node_[twin(f).node].push_back(f);
    for (const int cell : space_.cells_of(space_.functions()[kept_[f]]))
      in_cell_[cell].push_back(f);
  }
}

Vector3 CutFunctions::gradient_beyond(int k, const Place& place, const Vector3& whole) const {
  ScalarTerm term{kept_[k], 0, Vector3::Zero()};
  const bool is_there = space_.term_at(kept_[k], place.part, place.sample, term);
  if (twin(k).is_step && !has_part(twin(k), place.part))
    return Vector3::Zero();
  if (twin(k).is_step)
    return BeyondStep(twin(k)).of(whole, is_there ? term.gradient : Vector3(Vector3::Zero()));
  return is_there ? whole : Vector3(Vector3::Zero());
}

bool CutFunctions::evaluate(const Vector3& x, ShapeFunctions& shape) const {
  if (!solvers::evaluate(uncut_->spheres(), x, shape))
    return false;
  if (appended() == 0)
    return true;
  const PartId part = space_.part_at(x);
  thread_local CutTerms terms;
  space_.take_out_faint(x, part, shape);
  space_.terms_at(x, part, shape, terms);
  std::map<int, const ScalarTerm*> term_of; // few
  for (const ScalarTerm& term : terms.scalar)
    term_of[term.function] = &term;
  const int spheres = shape.size();
  std::vector<int> place_of(kept_.size(), -1); // of an appended function in `shape`
  for (int k = 0; k < spheres; ++k) {
    const double whole = shape.value[k];
    const Vector3 slope = shape.gradient(k);
    const auto take = [&](int place, double value, const Vector3& gradient) {
      shape.value[place] -= value;
      shape.dx[place] -= gradient.x();
      shape.dy[place] -= gradient.y();
      shape.dz[place] -= gradient.z();
    };
    for (const int f : of_node_[shape.nodes[k]]) { // twins before the steps that they host
      const auto term = term_of.find(kept_[f]);
      double beyond = 0;
      Vector3 gradient = Vector3::Zero();
      if (twin(f).is_step) {
        if (!has_part(twin(f), part))
          continue;
        const BeyondStep step(twin(f));
        const bool is_there = term != term_of.end();
        beyond = step.of(whole, is_there ? term->second->value : 0.0);
        gradient = step.of(slope, is_there ? term->second->gradient : Vector3(Vector3::Zero()));
      } else if (term != term_of.end()) {
        beyond = whole;
        gradient = slope;
      }
      if (beyond == 0 && gradient.isZero(0))
        continue;
      take(host_[f] < 0 ? k : place_of[host_[f]], beyond, gradient);
      place_of[f] = shape.size();
      shape.nodes.push_back(uncut_->size() + f);
      shape.value.push_back(beyond);
      shape.dx.push_back(gradient.x());
      shape.dy.push_back(gradient.y());
      shape.dz.push_back(gradient.z());
    }
  }
  int kept = 0;
  for (int k = 0; k < shape.size(); ++k) {
    if (shape.value[k] == 0 && shape.gradient(k).isZero(0))
      continue;
    shape.nodes[kept] = shape.nodes[k];
    shape.value[kept] = shape.value[k];
    shape.dx[kept] = shape.dx[k];
    shape.dy[kept] = shape.dy[k];
    shape.dz[kept] = shape.dz[k];
    ++kept;
  }
  shape.nodes.resize(kept);
  for (std::vector<double>* values : {&shape.value, &shape.dx, &shape.dy, &shape.dz})
    values->resize(kept);
  return true;
}

bool CutFunctions::has_step(int cell) const {
  return std::any_of(in_cell_[cell].begin(), in_cell_[cell].end(), [&](int f) { return twin(f).is_step; });
}

std::vector<CutFunctions::Place> CutFunctions::places_in(int cell) const {
  const BoxShapes& shapes = uncut_->boxes().cells()[cell];
  const bool sampled = has_step(cell);
  std::vector<Place> places;
  for (int box = shapes.first_box; box < shapes.first_box + shapes.boxes; ++box)
    for (int p = 0; p < space_.cut().part_count(box); ++p) {
      const PartId part = part_id(box, p);
      const CutPart of = space_.cut().part(part);
      const double volume = uncut_->boxes().boxes()[box].volume * of.share;
      if (!sampled) {
        places.push_back({part, 0, {of.centroid, volume}});
        continue;
      }
      const PlacedPart& samples = space_.samples(part);
      for (int n = 0; n < std::ssize(samples); ++n)
        places.push_back({part, n, {samples[n].at, volume * samples[n].share}});
    }
  return places;
}

/// Places of a cell that parts of its boxes join.
std::vector<std::vector<CutFunctions::Place>> CutFunctions::sides_of(int cell) const {
  std::vector<Place> places = places_in(cell);
  const BoxShapes& shapes = uncut_->boxes().cells()[cell];
  bool divided = false;
  for (int box = shapes.first_box; box < shapes.first_box + shapes.boxes; ++box)
    divided = divided || space_.cut().is_divided(box);
  if (!divided)
    return {std::move(places)};
  std::map<PartId, int> number;
  for (const Place& place : places)
    number.try_emplace(place.part, static_cast<int>(number.size()));
  topology::DisjointSets joined(static_cast<int>(number.size()));
  for (const auto& numbered : number)
    space_.cut().for_each_linked(numbered.first, [&](PartId other) {
      if (const auto found = number.find(other); found != number.end())
        joined.join(numbered.second, found->second);
    });
  std::map<int, std::vector<Place>> sides;
  for (Place& place : places)
    sides[joined.find(number.at(place.part))].push_back(place);
  std::vector<std::vector<Place>> result;
  result.reserve(sides.size());
  for (auto& [root, side] : sides)
    result.push_back(std::move(side));
  return result;
}

void CutFunctions::append_groups(int cell, const std::vector<Place>& places, int cell_of_table,
                                 PointTable& table) const {
  const SmallBoxes& boxes = uncut_->boxes();
  const BoxShapes& shapes = boxes.cells()[cell];
  const int base = uncut_->size();
  struct Slot {
    int function;
    std::array<LaneValues, 3> gradient;
  };
  const auto is_zero = [](const Slot& slot) {
    return std::all_of(slot.gradient.begin(), slot.gradient.end(), [](const LaneValues& values) {
      return std::all_of(std::begin(values.value), std::end(values.value), [](double v) { return v == 0; });
    });
  };
  for (std::size_t first = 0; first < places.size(); first += point_lanes) {
    const auto here = std::span(places).subspan(first, std::min<std::size_t>(point_lanes, places.size() - first));
    LaneValues weights;
    Vector3 centroid = Vector3::Zero();
    double volume = 0;
    for (int lane = 0; lane < point_lanes; ++lane) {
      const bool is_there = lane < std::ssize(here);
      const QuadraturePoint& point = here[is_there ? lane : 0].point;
      table.positions.push_back(point.position);
      if (!is_there)
        continue;
      weights.value[lane] = point.weight;
      centroid += point.weight * point.position;
      volume += point.weight;
    }
    centroid /= volume;
    std::vector<Slot> slots, behind; // of the spheres, of what is appended
    for (std::size_t k = 0; k < shapes.nodes.size(); ++k) {
      Slot own{shapes.nodes[k], {}};
      for (int lane = 0; lane < std::ssize(here); ++lane) {
        const Vector3 gradient = shapes.gradient_at(k, boxes.lane_of(box_of(here[lane].part)));
        for (int axis = 0; axis < 3; ++axis)
          own.gradient[axis].value[lane] = gradient[axis];
      }
      const std::size_t first_behind = behind.size();
      for (const int f : of_node_[shapes.nodes[k]]) { // twins before the steps that they host
        Slot& beyond = behind.emplace_back(Slot{base + f, {}});
        Slot* host = &own;
        for (std::size_t other = first_behind; other < behind.size(); ++other)
          if (host_[f] >= 0 && behind[other].function == base + host_[f])
            host = &behind[other];
        for (int lane = 0; lane < std::ssize(here); ++lane) {
          const Vector3 whole = shapes.gradient_at(k, boxes.lane_of(box_of(here[lane].part)));
          const Vector3 gradient = gradient_beyond(f, here[lane], whole);
          for (int axis = 0; axis < 3; ++axis) {
            beyond.gradient[axis].value[lane] = gradient[axis];
            host->gradient[axis].value[lane] -= gradient[axis];
          }
        }
      }
      if (!is_zero(own))
        slots.push_back(own);
    }
    std::erase_if(behind, is_zero);
    std::sort(behind.begin(), behind.end(), [](const Slot& a, const Slot& b) { return a.function < b.function; });
    slots.insert(slots.end(), behind.begin(), behind.end());
    for (const Slot& slot : slots) {
      table.nodes.push_back(slot.function);
      for (const LaneValues& values : slot.gradient)
        table.gradients.push_back(values);
      const int node = node_of(slot.function);
      const double distance = (centroid - uncut_->spheres().centres()[node]).norm() / uncut_->spheres().radii()[node];
      table.shares.push_back(volume * std::max(quartic_spline(distance), 1e-3));
    }
    table.start.push_back(static_cast<int>(table.nodes.size()));
    table.weights.push_back(weights);
    table.count.push_back(static_cast<int>(here.size()));
    table.cell.push_back(cell_of_table);
  }
}

PointTable CutFunctions::tabulate(BackgroundCells& cells) const {
  const SmallBoxes& boxes = uncut_->boxes();
  PointTable table;
  cells = {};
  for (const int cell : boxes.cells_by_place()) {
    const BoxShapes& shapes = boxes.cells()[cell];
    BackgroundBox box{shapes.centre, shapes.half, static_cast<int>(cells.start.size()) - 1, 0};
    for (const std::vector<Place>& side : sides_of(cell)) {
      append_groups(cell, side, static_cast<int>(cells.start.size()) - 1, table);
      for (const Place& place : side)
        cells.points.push_back(place.point);
      cells.start.push_back(static_cast<int>(cells.points.size()));
    }
    box.last_cell = static_cast<int>(cells.start.size()) - 1;
    cells.boxes.push_back(box);
  }
  return table;
}

// A twin that was not there goes on as its node, with which it was one; a step as what was most like it.
VectorX CutFunctions::state_from(const CutFunctions& before, const VectorX& coefficients,
                                 std::vector<char>& is_new) const {
  const auto at = [](int function) { return 3 * static_cast<Eigen::Index>(function); };
  const int base = uncut_->size();
  VectorX state(at(size()));
  state.head(at(base)) = coefficients.head(at(base));
  is_new.assign(static_cast<std::size_t>(size()), 0);
  for (int f = 0; f < appended(); ++f) {
    const Twin& now = twin(f);
    int best = now.node;
    std::size_t most = 0;
    is_new[base + f] = 1;
    for (const int b : before.of_node_[now.node]) {
      const Twin& was = before.twin(b);
      std::vector<PartId> both;
      std::set_intersection(was.hidden.begin(), was.hidden.end(), now.hidden.begin(), now.hidden.end(),
                            std::back_inserter(both));
      if (both.size() > most) {
        most = both.size();
        best = base + b;
      }
      if (!now.is_step && !was.is_step && now.hidden == was.hidden)
        is_new[base + f] = 0;
    }
    state.segment<3>(at(base + f)) = coefficients.segment<3>(at(best));
  }
  return state;
}

} // namespace spherecut::solvers
