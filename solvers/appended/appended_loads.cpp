// What loads a cut body, on the functions of the uncut body and on those that the cut has appended: body force and
// initial stress by the parts of the boxes, tractions by points of the surface and of the faces.
#include "solvers/appended/appended_body.hpp"

#include "solvers/body/elastic_body.hpp"

#include <utility>

namespace spherecut::solvers {

/// A force at a point goes to all functions there.
void AppendedBody::add_force(const Vector3& x, const Vector3& force) {
  const PartId part = space_->part_at(x);
  if (is_dropped(part))
    return;
  thread_local ShapeFunctions shape;
  thread_local CutTerms terms;
  uncut_->boxes().evaluate(box_of(part), x, shape);
  space_->take_out_faint(x, part, shape);
  space_->terms_at(x, part, shape, terms);
  for (int k = 0; k < shape.size(); ++k)
    loads_.base.col(0).segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k])) += shape.value[k] * force;
  for (const ScalarTerm& term : terms.scalar)
    loads_.cut.col(0).segment<3>(3 * static_cast<Eigen::Index>(term.function)) += term.value * force;
  for (const FrontTerm& term : terms.front)
    loads_.cut.col(0).segment<3>(3 * static_cast<Eigen::Index>(term.function)) += term.value.transpose() * force;
}

/// Body force and initial strain on the functions of the uncut body: the same whatever is cut, but for parts that are
/// left out.
VectorX AppendedBody::volume_loads_of_uncut() const {
  const Loads& loads = problem_.loads;
  const Matrix3 initial = initial_stress(problem_);
  const SmallBoxes& boxes = uncut_->boxes();
  VectorX result = VectorX::Zero(loads_.base.rows());
  for (int box = 0; box < boxes.size(); ++box) {
    double left = 0;
    for (int k = 0; k < space_->cut().part_count(box); ++k)
      left += is_dropped(part_id(box, k)) ? 0 : space_->cut().part(part_id(box, k)).share;
    if (left == 0)
      continue;
    const BoxShapes& cell = boxes.cells()[boxes.cell_of(box)];
    const int lane = boxes.lane_of(box);
    const double volume = left * boxes.boxes()[box].volume;
    const Vector3 force =
        loads.body_force ? Vector3(volume * loads.body_force(boxes.boxes()[box].middle)) : Vector3(Vector3::Zero());
    for (std::size_t n = 0; n < cell.nodes.size(); ++n)
      result.segment<3>(3 * static_cast<Eigen::Index>(cell.nodes[n])) +=
          cell.value_at(n, lane) * force + volume * initial * cell.gradient_at(n, lane);
  }
  return result;
}

/// The same on the functions that the cut has appended.
void AppendedBody::add_volume_loads_of_cut() {
  const Loads& loads = problem_.loads;
  const Matrix3 initial = initial_stress(problem_);
  const SmallBoxes& boxes = uncut_->boxes();
  const auto volume_of = [&](PartId id) { return space_->cut().part(id).share * boxes.boxes()[box_of(id)].volume; };
  const auto weight_of = [&](PartId id) -> Vector3 {
    return loads.body_force ? Vector3(volume_of(id) * loads.body_force(space_->cut().part(id).centroid))
                            : Vector3(Vector3::Zero());
  };
  for (const int cell : space_->cells_of_groups(0))
    space_->for_each_front_term(0, cell, [&](PartId part, int sample, const FrontTerm& term) {
      if (is_dropped(part))
        return;
      auto to = loads_.cut.col(0).segment<3>(3 * static_cast<Eigen::Index>(term.function));
      const double share = space_->samples(part)[sample].share;
      to += share * term.value.transpose() * weight_of(part);
      for (int m = 0; m < 3; ++m)
        to[m] += share * volume_of(part) * initial.cwiseProduct(term.gradient[m]).sum();
    });
  std::unordered_map<int, Vector3> known; // of functions that are kept nothing has changed
  for (int k = 0; k < std::ssize(space_->functions()); ++k) {
    const CutFunction& function = space_->functions()[k];
    if (function.is_front)
      continue;
    const auto before = dropped_.empty() ? twin_loads_.find(function.id) : twin_loads_.end();
    const Vector3 load = before != twin_loads_.end() ? before->second : twin_load(k, initial);
    loads_.cut.col(0).segment<3>(3 * static_cast<Eigen::Index>(k)) += load;
    if (dropped_.empty())
      known.emplace(function.id, load);
  }
  twin_loads_ = std::move(known);
}

/// N, of body force and initial stress on a twin.
Vector3 AppendedBody::twin_load(int k, const Matrix3& initial) const {
  const Loads& loads = problem_.loads;
  const SmallBoxes& boxes = uncut_->boxes();
  const CutFunction& function = space_->functions()[k];
  Vector3 load = Vector3::Zero();
  PartId last = -1;
  for (const PartId id : system_->parts_of(k)) {
    if (id == last || is_dropped(id))
      continue;
    last = id;
    const CutPart part = space_->cut().part(id);
    const double volume = part.share * boxes.boxes()[box_of(id)].volume;
    const Vector3 weight = loads.body_force ? Vector3(volume * loads.body_force(part.centroid)) : Vector3::Zero();
    ScalarTerm term;
    if (!function.twin.is_step) { // its value is that at the middle of the box
      if (!space_->term_at(k, id, 0, term))
        continue;
      const Vector3 off = part.centroid - boxes.boxes()[box_of(id)].middle;
      load += (term.value + term.gradient.dot(off)) * weight + volume * initial * term.gradient;
      continue;
    }
    const PlacedPart& samples = space_->samples(id);
    for (int n = 0; n < std::ssize(samples); ++n)
      if (space_->term_at(k, id, n, term))
        load += samples[n].share * (term.value * weight + volume * initial * term.gradient);
  }
  return load;
}

void AppendedBody::assemble_loads() {
  loads_ = system_->zero(1);
  const Loads& loads = problem_.loads;
  if (loads.body_force || !initial_stress(problem_).isZero(0)) {
    if (uncut_loads_.size() == 0 || !dropped_.empty())
      uncut_loads_ = volume_loads_of_uncut();
    loads_.base.col(0) = uncut_loads_;
    if (!dropped_.empty())
      uncut_loads_.resize(0);
    add_volume_loads_of_cut();
  }
  const topology::Incision* incision = problem_.incision.get();
  if (loads.traction)
    for (const SurfacePoint& point : surface_quadrature(*problem_.domain, problem_.nodes, 0.5, 0, incision)) {
      const Vector3 traction = loads.traction(point.position, point.normal);
      if (!traction.isZero(0))
        add_force(point.position, point.weight * traction);
    }
  if (loads.lip_traction && incision != nullptr)
    for (const SurfacePoint& point : lip_quadrature(*incision, uncut_->nodes()))
      add_force(point.position, point.weight * loads.lip_traction(point.position, point.normal));
}

} // namespace spherecut::solvers
