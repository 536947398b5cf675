#include "solvers/appended/cut_space.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
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
      twins_of_(nodes.positions.size()), groups_of_(nodes.positions.size()), group_weights_(nodes.positions.size()) {}

double CutSpace::front_reach() const {
  const double widest = *std::max_element(nodes_.spacings.begin(), nodes_.spacings.end());
  const double largest = *std::max_element(spheres_.radii().begin(), spheres_.radii().end());
  return options_.front.radius * widest + largest + 2 * widest;
}

std::vector<int> CutSpace::boxes_in_reach(int node) const {
  const Vector3& x = spheres_.centres()[node];
  const double radius = spheres_.radii()[node];
  std::vector<int> near;
  boxes_.within({x.array() - radius, x.array() + radius}, near);
  std::erase_if(near, [&](int box) {
    const SmallBox& at = boxes_.boxes()[box];
    return (x - at.centre).cwiseAbs().cwiseMax(at.half).operator-(at.half).squaredNorm() >= radius * radius;
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
  const double squared = (a > 0 ? b * b / (r + a + 1e-300) : r - a) / (2 * length), t = std::sqrt(std::max(0.0, squared));
  if (t >= 1)
    return side;
  if (t > 0 && r > 0) {
    const double slope = side * 15 * (1 - squared) * (1 - squared) / (8 * 4 * length * t);
    gradient = slope * ((a / r - 1) * place->grad_ahead + b / r * place->grad_above);
  }
  return side * t * (15 - 10 * squared + 3 * squared * squared) / 8;
}

const FrontPlace* CutSpace::place_of(PartId part) const {
  auto known = places_.find(part);
  if (known == places_.end()) {
    const CutPart at = cut_.part(part);
    const SmallBox& box = boxes_.boxes()[box_of(part)];
    const double radius = box.half.norm();
    std::optional<FrontPlace> place = front_place(*incision_, at.centroid, front_reach());
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
    known = places_.emplace(part, place).first;
  }
  return known->second ? &*known->second : nullptr;
}

// Components of the parts in reach of a sphere: its node's own one, and a twin for each of the others. Where all hang
// together although a sheet divides some, the sphere has a step.
void CutSpace::add_twins(int node, std::vector<CutFunction>& found) const {
  const std::vector<int> reach = boxes_in_reach(node);
  if (std::none_of(reach.begin(), reach.end(), [&](int box) { return cut_.is_divided(box); }))
    return;
  std::vector<PartId> parts;
  std::unordered_map<PartId, int> place;
  for (const int box : reach)
    for (int k = 0; k < cut_.part_count(box); ++k) {
      place[part_id(box, k)] = static_cast<int>(parts.size());
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
        const auto known = place.find(next);
        if (known != place.end() && component[known->second] < 0) {
          component[known->second] = count;
          pending.push_back(known->second);
        }
      });
    }
    ++count;
  }
  const Vector3& x = spheres_.centres()[node];
  const auto own_place = place.find(cut_.part_at(x, *incision_));
  const int own = own_place == place.end() ? component.front() : component[own_place->second];
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
  const auto sheet = incision_->closest(x, radius);
  if (!sheet)
    return;
  CutFunction function;
  Twin& twin = function.twin;
  twin.node = node;
  twin.is_step = true;
  twin.hidden = std::move(parts);
  twin.step_length = options_.step_reach * nodes_.spacings[node];
  const auto at = front_place(*incision_, x, front_reach());
  Vector3 gradient;
  twin.step_at_node = step(at ? &*at : nullptr, x, twin.step_length, gradient);
  found.push_back(std::move(function));
}

CutSpace::Change CutSpace::update(std::shared_ptr<const topology::Incision> incision, const BoundingBox& region) {
  incision_ = std::move(incision);
  // Parts whose boxes, or whose places with respect to the front, are others now.
  std::vector<int> divided = cut_.update(*incision_, region);
  std::vector<char> changed(boxes_.size(), 0);
  for (const int box : divided)
    changed[box] = 1;
  for (auto known = places_.begin(); known != places_.end();) {
    const int box = box_of(known->first);
    if (changed[box] != 0 || known->first % most_parts >= cut_.part_count(box)) {
      known = places_.erase(known);
      continue;
    }
    ++known;
  }
  // The nearest place of the front changes where the front did.
  std::vector<PartId> kept_places;
  kept_places.reserve(places_.size());
  for (const auto& [part, place] : places_)
    kept_places.push_back(part);
  std::sort(kept_places.begin(), kept_places.end());
  for (const PartId part : kept_places) {
    const std::optional<FrontPlace> before = places_.at(part);
    // Far from what has changed the front is where it was.
    const Vector3& x = boxes_.boxes()[box_of(part)].centre;
    const double away = (x - region.lower.cwiseMax(x.cwiseMin(region.upper))).norm();
    if (before && away > before->distance + boxes_.boxes()[box_of(part)].half.norm())
      continue;
    places_.erase(part);
    const FrontPlace* now = place_of(part);
    if ((now != nullptr) != before.has_value() ||
        (now != nullptr && (now->ahead != before->ahead || now->above != before->above ||
                            now->grad_ahead != before->grad_ahead || now->grad_above != before->grad_above)))
      changed[box_of(part)] = 2;
  }

  // Twins of spheres in reach of what has changed are found anew.
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
          const std::vector<int> boxes = boxes_of(old);
          stays = std::none_of(boxes.begin(), boxes.end(), [&](int box) { return changed[box] != 0; });
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
          if (twin_taken[w] == 0 && wanted[w].twin.node == old.twin.node && wanted[w].twin.is_step == old.twin.is_step &&
              wanted[w].twin.step_at_node == old.twin.step_at_node && wanted[w].twin.hidden == old.twin.hidden &&
              !is_touched) {
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

std::vector<int> CutSpace::boxes_of(const CutFunction& function) const {
  std::vector<int> boxes;
  if (!function.is_front) {
    for (const PartId part : function.twin.hidden)
      boxes.push_back(box_of(part));
  } else {
    for (const int node : function.group.nodes) {
      const std::vector<int> reach = boxes_in_reach(node);
      boxes.insert(boxes.end(), reach.begin(), reach.end());
    }
    std::sort(boxes.begin(), boxes.end());
  }
  boxes.erase(std::unique(boxes.begin(), boxes.end()), boxes.end());
  return boxes;
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
  const double jump = 0.5 * (step(place_of(part), x, twin.step_length, slope) - twin.step_at_node);
  term = {k, value * jump, jump * gradient + 0.5 * value * slope};
  return jump != 0 || !slope.isZero(0);
}

bool CutSpace::term_at(int k, PartId part, FrontTerm& term) const {
  const FrontGroup& group = functions_[k].group;
  const int box = box_of(part), lane = boxes_.lane_of(box);
  const BoxShapes& cell = boxes_.cells()[boxes_.cell_of(box)];
  double middle = 0;
  Vector3 gradient = Vector3::Zero();
  // Both lists ascend.
  std::size_t c = 0;
  for (std::size_t n = 0; n < group.nodes.size(); ++n) {
    while (c < cell.nodes.size() && cell.nodes[c] < group.nodes[n])
      ++c;
    if (c == cell.nodes.size())
      break;
    if (cell.nodes[c] != group.nodes[n])
      continue;
    middle += group.weights[n] * cell.value_at(c, lane);
    gradient += group.weights[n] * cell.gradient_at(c, lane);
  }
  if (middle == 0 && gradient.isZero(0))
    return false;
  const FrontPlace* place = place_of(part);
  if (place == nullptr)
    return false;
  const double value = middle + gradient.dot(cut_.part(part).centroid - boxes_.boxes()[box].middle);
  const FrontFields fields = front_fields(material_, group.station, *place);
  term.function = k;
  term.value = value * fields.value;
  for (int mode = 0; mode < 3; ++mode)
    term.gradient[mode] = value * fields.gradient[mode] + fields.value.col(mode) * gradient.transpose();
  return true;
}

void CutSpace::terms_at(const Vector3& x, PartId part, const ShapeFunctions& shape, CutTerms& terms) const {
  terms.clear();
  if (functions_.empty())
    return;
  std::optional<FrontPlace> place;
  bool placed = false;
  const auto place_here = [&]() -> const FrontPlace* {
    if (!placed) {
      place = front_place(*incision_, x, front_reach());
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
  for (const auto& [k, sum] : of_group) {
    const FrontFields fields = front_fields(material_, functions_[k].group.station, *place);
    FrontTerm term{k, sum.first * fields.value, {}};
    for (int mode = 0; mode < 3; ++mode)
      term.gradient[mode] = sum.first * fields.gradient[mode] + fields.value.col(mode) * sum.second.transpose();
    terms.front.push_back(term);
  }
}

} // namespace spherecut::solvers
