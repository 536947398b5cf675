#include "solvers/appended/cut_space.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

namespace spherecut::solvers {

namespace {

constexpr double near_front_boxes = 3;  // half diagonals of a box: nearer to a front its place is a harmonic mean
constexpr int harmonic_samples = 4;     // along an edge of the box
constexpr double nearest_sample = 0.05; // half diagonals: samples count as this far from the front at least

} // namespace

CutSpace::CutSpace(const SmallBoxes& boxes, const topology::Domain& domain, const NodeCloud& nodes,
                   const Spheres& spheres, const Material& material, CutSpaceOptions options)
    : boxes_(boxes), nodes_(nodes), spheres_(spheres), material_(material), options_(options), cut_(boxes, domain),
      twins_of_(nodes.positions.size()), groups_of_(nodes.positions.size()), group_weights_(nodes.positions.size()),
      places_(most_parts * static_cast<std::size_t>(boxes.size())),
      local_(most_parts * static_cast<std::size_t>(boxes.size()), -1), reach_(nodes.positions.size()) {
  const double widest = *std::max_element(nodes_.spacings.begin(), nodes_.spacings.end());
  const double largest = *std::max_element(spheres_.radii().begin(), spheres_.radii().end());
  front_reach_ = options_.front.radius * widest + largest + 2 * widest;
}

const std::vector<int>& CutSpace::boxes_in_reach(int node) const {
  std::vector<int>& near = reach_[node];
  if (!near.empty())
    return near;
  const Vector3& x = spheres_.centres()[node];
  const double radius = spheres_.radii()[node];
  boxes_.within({x.array() - radius, x.array() + radius}, near);
  std::erase_if(near, [&](int box) {
    const SmallBox& at = boxes_.boxes()[box];
    return ((x - at.centre).cwiseAbs() - at.half).cwiseMax(0).squaredNorm() >= radius * radius;
  });
  return near;
}

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

PlacedFields& CutSpace::place_of(PartId part) const {
  std::unique_ptr<PlacedFields>& known = places_[part];
  if (known == nullptr) {
    const CutPart at = cut_.part(part);
    const SmallBox& box = boxes_.boxes()[box_of(part)];
    const double radius = box.half.norm();
    std::optional<FrontPlace> place = front_place(*incision_, at.centroid, front_reach_);
    if (place && place->distance < near_front_boxes * radius) {
      // What is integrated goes with 1 / r: the place stands where r is its harmonic mean over the part.
      double sum = 0;
      int count = 0;
      const bool divided = cut_.part_count(box_of(part)) > 1;
      const Vector3 half = box.half / harmonic_samples;
      const Matrix3 across =
          place->grad_ahead * place->grad_ahead.transpose() + place->grad_above * place->grad_above.transpose();
      topology::SheetPoint sheet; // no part of an undivided box lies beyond it
      if (const auto nearest = divided ? incision_->closest(box.centre, radius) : std::nullopt)
        sheet = *nearest;
      const double side = sheet.normal.dot(at.centroid - sheet.point);
      for (int a = 0; a < harmonic_samples; ++a)
        for (int b = 0; b < harmonic_samples; ++b)
          for (int c = 0; c < harmonic_samples; ++c) {
            const Vector3 x = box.centre - box.half + half.cwiseProduct(Vector3(2 * a + 1, 2 * b + 1, 2 * c + 1));
            if (sheet.normal.dot(x - sheet.point) * side < 0)
              continue;
            const Vector3 arm = across * (x - place->nearest);
            sum += 1 / std::max(nearest_sample * radius, arm.norm());
            ++count;
          }
      if (const double r = std::hypot(place->ahead, place->above); count > 0 && r > 0) {
        const double factor = count / sum / std::max(r, 1e-6 * radius);
        place->ahead *= factor;
        place->above *= factor;
      }
    }
    known = std::make_unique<PlacedFields>();
    known->place = place;
    if (place)
      known->tip = tip_fields(material_, *place);
    placed_.push_back(part);
  }
  return *known;
}

// Components of the parts in reach of a sphere: its node's own one, and a twin for each of the others. Where all hang
// together although a sheet divides some, the sphere has a step.
void CutSpace::add_twins(int node, std::vector<CutFunction>& found) const {
  const std::vector<int>& reach = boxes_in_reach(node);
  if (std::none_of(reach.begin(), reach.end(), [&](int box) { return cut_.is_divided(box); }))
    return;
  std::vector<PartId> parts;
  for (const int box : reach)
    for (int k = 0; k < cut_.part_count(box); ++k) {
      local_[part_id(box, k)] = static_cast<int>(parts.size());
      parts.push_back(part_id(box, k));
    }
  std::vector<int> component(parts.size(), -1);
  int count = 0;
  std::vector<int> pending;
  for (std::size_t start = 0; start < parts.size(); ++start) {
    if (component[start] >= 0)
      continue;
    component[start] = count;
    pending.assign(1, static_cast<int>(start));
    while (!pending.empty()) {
      const int at = pending.back();
      pending.pop_back();
      cut_.for_each_linked(parts[at], [&](PartId next) {
        const int place = local_[next];
        if (place >= 0 && component[place] < 0) {
          component[place] = count;
          pending.push_back(place);
        }
      });
    }
    ++count;
  }
  const Vector3& x = spheres_.centres()[node];
  const int own_place = local_[cut_.part_at(x, *incision_)];
  const int own = own_place < 0 ? component.front() : component[own_place];
  for (const PartId part : parts)
    local_[part] = -1;
  // A part in which the sphere has no weight asks for nothing.
  const auto weighs = [&](PartId part) {
    const int box = box_of(part);
    const BoxShapes& cell = boxes_.cells()[boxes_.cell_of(box)];
    const auto at = std::lower_bound(cell.nodes.begin(), cell.nodes.end(), node);
    return at != cell.nodes.end() && *at == node &&
           (cell.value_at(at - cell.nodes.begin(), boxes_.lane_of(box)) != 0 ||
            !cell.gradient_at(at - cell.nodes.begin(), boxes_.lane_of(box)).isZero(0));
  };
  bool any = false;
  for (int c = 0; c < count; ++c) {
    if (c == own)
      continue;
    CutFunction function;
    function.twin.node = node;
    bool heavy = false;
    for (std::size_t k = 0; k < parts.size(); ++k)
      if (component[k] == c) {
        function.twin.hidden.push_back(parts[k]);
        heavy = heavy || weighs(parts[k]);
      }
    any = true;
    if (heavy)
      found.push_back(std::move(function));
  }
  if (any || options_.step_reach <= 0)
    return;
  // The front ends in the sphere, or passes beside it.
  const double radius = spheres_.radii()[node];
  const auto nearest = incision_->front_frame(x, 2 * radius);
  if (!nearest || curved_[nearest->segment] == 0 || !incision_->closest(x, radius))
    return;
  CutFunction function;
  Twin& twin = function.twin;
  twin.node = node;
  twin.is_step = true;
  twin.hidden = std::move(parts);
  twin.step_length = options_.step_reach * nodes_.spacings[node];
  const auto at = front_place(*incision_, x, front_reach_);
  Vector3 gradient;
  twin.step_at_node = step(at ? &*at : nullptr, x, twin.step_length, gradient);
  found.push_back(std::move(function));
}

void CutSpace::find_curved_front() {
  const double least = std::cos(options_.step_turn * std::numbers::pi / 180);
  const std::vector<topology::FrontSegment>& front = incision_->front();
  std::vector<Vector3> middle, ahead;
  std::vector<char> turns;
  for (int s = 0; s < std::ssize(front); ++s) {
    middle.emplace_back(0.5 * (front[s].from + front[s].to));
    ahead.push_back(incision_->front_frame_at(s, 0.5).ahead);
  }
  for (std::size_t s = 0; s < front.size(); ++s) {
    double radius = 0;
    for (const int node : spheres_.candidates(middle[s]))
      if ((spheres_.centres()[node] - middle[s]).norm() < spheres_.radii()[node])
        radius = std::max(radius, spheres_.radii()[node]);
    char turn = 0;
    for (std::size_t other = 0; other < front.size() && turn == 0; ++other)
      turn = (middle[other] - middle[s]).squaredNorm() < radius * radius && ahead[other].dot(ahead[s]) < least;
    turns.push_back(turn);
  }
  curved_.assign(front.size(), 0);
  for (const std::vector<int>& run : front_runs(*incision_)) {
    double length = 0, turning = 0;
    for (const int s : run) {
      length += (front[s].to - front[s].from).norm();
      turning += turns[s] != 0 ? (front[s].to - front[s].from).norm() : 0;
    }
    for (const int s : run)
      curved_[s] = turning > 0.5 * length ? 1 : 0;
  }
}

CutSpace::Change CutSpace::update(std::shared_ptr<const topology::Incision> incision, const BoundingBox& region) {
  incision_ = std::move(incision);
  // Parts whose boxes, or whose places with respect to the front, are others now.
  std::vector<int> divided = cut_.update(*incision_, region);
  std::vector<char> changed(boxes_.size(), 0);
  for (const int box : divided)
    changed[box] = 1;
  // The nearest place of the front changes where the front did. Far from what has changed it is where it was.
  const auto is_far = [&](const Vector3& x, double radius, const PlacedFields& before) {
    const double away = (x - region.lower.cwiseMax(x.cwiseMin(region.upper))).norm();
    return away > (before.place ? before.place->distance : front_reach_) + radius;
  };
  const auto is_other = [](const std::optional<FrontPlace>& before, const std::optional<FrontPlace>& now) {
    return now.has_value() != before.has_value() ||
           (now && (now->ahead != before->ahead || now->above != before->above ||
                    now->grad_ahead != before->grad_ahead || now->grad_above != before->grad_above));
  };
  std::vector<PartId> before_parts = std::move(placed_);
  placed_.clear();
  std::sort(before_parts.begin(), before_parts.end());
  for (const PartId part : before_parts) {
    const int box = box_of(part);
    std::unique_ptr<PlacedFields> before = std::move(places_[part]);
    if (changed[box] == 1 || part % most_parts >= cut_.part_count(box))
      continue;
    if (is_far(boxes_.boxes()[box].centre, boxes_.boxes()[box].half.norm(), *before)) {
      places_[part] = std::move(before);
      placed_.push_back(part);
    } else if (is_other(before->place, place_of(part).place)) {
      changed[box] = 2;
    }
  }
  std::vector<char> cell_changed(boxes_.cells().size(), 0);
  for (int box = 0; box < boxes_.size(); ++box)
    if (changed[box] != 0)
      cell_changed[boxes_.cell_of(box)] = 1;

  // Twins of spheres in reach of what has changed are found anew.
  const std::vector<char> was_curved = std::move(curved_);
  find_curved_front();
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
  const auto any = [](const std::vector<char>& flags) {
    return std::any_of(flags.begin(), flags.end(), [](char is) { return is != 0; });
  };
  if (any(was_curved) || any(curved_)) // a step comes or goes with its run
    for (int box = 0; box < boxes_.size(); ++box)
      if (cut_.is_divided(box))
        for (const int node : boxes_.cells()[boxes_.cell_of(box)].nodes)
          concerned.insert(node);
  std::vector<CutFunction> wanted;
  for (const int node : concerned)
    add_twins(node, wanted);
  std::vector<FrontGroup> groups = front_groups(*incision_, nodes_, options_.front, origins_);

  Change change;
  std::vector<CutFunction> next;
  std::vector<char> twin_taken(wanted.size(), 0), group_taken(groups.size(), 0);
  for (int k = 0; k < std::ssize(functions_); ++k) {
    CutFunction& old = functions_[k];
    bool stays = false;
    if (old.is_front) {
      for (std::size_t g = 0; g < groups.size() && !stays; ++g)
        if (group_taken[g] == 0 && groups[g] == old.group) {
          const std::vector<int> cells = cells_of(old);
          stays = std::none_of(cells.begin(), cells.end(), [&](int cell) { return cell_changed[cell] != 0; });
          if (stays)
            group_taken[g] = 1;
        }
    } else if (!concerned.contains(old.twin.node) && !old.twin.is_step) {
      stays = true;
    } else {
      const bool is_touched = std::any_of(old.twin.hidden.begin(), old.twin.hidden.end(), [&](PartId part) {
        return changed[box_of(part)] == 1 || (old.twin.is_step && changed[box_of(part)] != 0);
      });
      if (!concerned.contains(old.twin.node)) {
        stays = !is_touched;
        if (!stays) { // a step whose front has moved on elsewhere
          std::vector<CutFunction> anew;
          add_twins(old.twin.node, anew);
          wanted.insert(wanted.end(), anew.begin(), anew.end());
          twin_taken.resize(wanted.size(), 0);
        }
      } else {
        for (std::size_t w = 0; w < wanted.size() && !stays; ++w)
          if (twin_taken[w] == 0 && wanted[w].twin.node == old.twin.node &&
              wanted[w].twin.is_step == old.twin.is_step && wanted[w].twin.step_at_node == old.twin.step_at_node &&
              wanted[w].twin.hidden == old.twin.hidden && !is_touched) {
            stays = true;
            twin_taken[w] = 1;
          }
      }
    }
    if (stays) {
      change.kept.push_back(k);
      next.push_back(std::move(old));
    }
  }
  const auto append = [&](CutFunction function) {
    function.id = next_id_++;
    next.push_back(std::move(function));
    ++change.added;
  };
  for (std::size_t w = 0; w < wanted.size(); ++w)
    if (twin_taken[w] == 0)
      append(std::move(wanted[w]));
  for (std::size_t g = 0; g < groups.size(); ++g)
    if (group_taken[g] == 0) {
      CutFunction function;
      function.is_front = true;
      function.group = std::move(groups[g]);
      append(std::move(function));
    }
  functions_ = std::move(next);
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
  return change;
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

bool CutSpace::term_at(int k, PartId part, ScalarTerm& term) const {
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
  const Vector3 x = cut_.part(part).centroid;
  const double value = middle + gradient.dot(x - boxes_.boxes()[box].middle);
  Vector3 slope;
  const std::optional<FrontPlace>& place_here = place_of(part).place;
  const double jump = 0.5 * (step(place_here ? &*place_here : nullptr, x, twin.step_length, slope) - twin.step_at_node);
  term = {k, value * jump, jump * gradient + 0.5 * value * slope};
  return jump != 0 || !slope.isZero(0);
}

// A group whose blended hats are `value`, with their gradient, at a place.
FrontTerm CutSpace::front_term(int k, double value, const Vector3& gradient, PlacedFields& placed) const {
  const FrontStation& station = functions_[k].group.station;
  if (placed.station.spacing != station.spacing || placed.station.point != station.point ||
      placed.station.axes != station.axes) {
    placed.fields = front_fields(material_, station, *placed.place, placed.tip);
    placed.station = station;
  }
  const FrontFields& fields = placed.fields;
  FrontTerm term{k, value * fields.value, {}};
  for (int mode = 0; mode < 3; ++mode)
    term.gradient[mode] = value * fields.gradient[mode] + fields.value.col(mode) * gradient.transpose();
  return term;
}

void CutSpace::terms_in(int k, int cell_index, std::vector<PartId>& parts, std::vector<FrontTerm>& terms) const {
  constexpr int lanes = BoxShapes::lanes;
  const FrontGroup& group = functions_[k].group;
  const BoxShapes& cell = boxes_.cells()[cell_index];
  parts.clear();
  terms.clear();
  std::array<double, lanes> middle{};
  std::array<Vector3, lanes> gradient;
  gradient.fill(Vector3::Zero());
  bool any = false;
  std::size_t c = 0; // both lists ascend
  for (std::size_t n = 0; n < group.nodes.size(); ++n) {
    while (c < cell.nodes.size() && cell.nodes[c] < group.nodes[n])
      ++c;
    if (c == cell.nodes.size())
      break;
    if (cell.nodes[c] != group.nodes[n])
      continue;
    any = true;
    for (int lane = 0; lane < cell.boxes; ++lane) {
      middle[lane] += group.weights[n] * cell.value_at(c, lane);
      gradient[lane] += group.weights[n] * cell.gradient_at(c, lane);
    }
  }
  for (int lane = 0; any && lane < cell.boxes; ++lane) {
    if (middle[lane] == 0 && gradient[lane].isZero(0))
      continue;
    const int box = cell.first_box + lane;
    for (int p = 0; p < cut_.part_count(box); ++p) {
      const PartId part = part_id(box, p);
      PlacedFields& placed = place_of(part);
      if (!placed.place)
        continue;
      terms.push_back(
          front_term(k, middle[lane] + gradient[lane].dot(cut_.part(part).centroid - boxes_.boxes()[box].middle),
                     gradient[lane], placed));
      parts.push_back(part);
    }
  }
}

void CutSpace::terms_at(const Vector3& x, PartId part, const ShapeFunctions& shape, CutTerms& terms) const {
  terms.clear();
  if (functions_.empty())
    return;
  std::optional<FrontPlace> place;
  bool placed = false;
  const auto place_here = [&]() -> const FrontPlace* {
    if (!placed) {
      place = front_place(*incision_, x, front_reach_);
      placed = true;
    }
    return place ? &*place : nullptr;
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
      Vector3 slope;
      const double jump = 0.5 * (step(place_here(), x, twin.step_length, slope) - twin.step_at_node);
      if (jump != 0 || !slope.isZero(0))
        terms.scalar.push_back({k, shape.value[n] * jump, jump * shape.gradient(n) + 0.5 * shape.value[n] * slope});
    }
    for (std::size_t g = 0; g < groups_of_[node].size(); ++g) {
      auto& [value, gradient] = of_group.try_emplace(groups_of_[node][g], 0, Vector3::Zero()).first->second;
      value += group_weights_[node][g] * shape.value[n];
      gradient += group_weights_[node][g] * shape.gradient(n);
    }
  }
  if (of_group.empty() || place_here() == nullptr)
    return;
  PlacedFields here{place, tip_fields(material_, *place), {}, {}};
  for (const auto& [k, sum] : of_group)
    terms.front.push_back(front_term(k, sum.first, sum.second, here));
}

} // namespace spherecut::solvers
