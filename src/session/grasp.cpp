// The grasper of a session: it takes hold of a patch of the surface, and the patch moves as it does.
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr std::array<bool, 3> all_axes{true, true, true};
constexpr double kept_about = 1.5; // fine spacings beyond the jaws: nodes that share the surface with the patch

topology::SurfaceContact grasped_place(const topology::Domain& domain, const Vector3& x) {
  topology::SurfaceContact contact;
  contact.point = domain.closest_surface_point(x);
  contact.normal = domain.normal(contact.point);
  contact.depth = -domain.signed_distance(x);
  return contact;
}

} // namespace

// Where the grasper will take hold of the organ at rest. Throws InputError when its path does not reach it; a device
// takes it elsewhere.
FirstTouch Session::find_grasp(const std::vector<ToolSample>& motion, Leader leader) const {
  const GraspSettings& settings = *scenario_.tool->grasp;
  FirstTouch touch;
  while (touch.sample + 1 < motion.size() && motion[touch.sample].time < settings.grasp)
    ++touch.sample;
  touch.pose = motion[touch.sample].pose;
  touch.contact = grasped_place(*organ_.domain, touch.pose.point);
  const double reach = topology::tip_radius(scenario_.tool->shape);
  const Vector3& x = touch.pose.point;
  if (const double away = (touch.contact.point - x).norm(); away > reach && leader == Leader::path)
    throw InputError(fmt::format("{}:{}: the grasper cannot reach the organ: when it takes hold, at t = {:g} s, it is "
                                 "at [{:.4g}, {:.4g}, {:.4g}] m, {:.3g} m from the surface at [{:.4g}, {:.4g}, "
                                 "{:.4g}] m; allowed: within tool.radius = {:g} m",
                                 scenario_.file.string(), scenario_.tool->line, motion[touch.sample].time, x.x(), x.y(),
                                 x.z(), away, touch.contact.point.x(), touch.contact.point.y(), touch.contact.point.z(),
                                 reach));
  return touch;
}

// Free nodes of the organ's surface between the jaws: within the radius of the place, not beyond a cut.
std::vector<int> Session::grasped_nodes(const BodyModel& model) const {
  const solvers::NodeCloud& nodes = model.sprinkling.nodes;
  const std::vector<std::array<bool, 3>> held = held_axes(fixed_nodes(scenario_, *organ_.domain, nodes), nodes.size());
  const double reach = topology::tip_radius(scenario_.tool->shape);
  const Vector3 inside = grasp_->place - 1e-3 * zone_.spacing.fine * grasp_->normal;
  std::vector<int> grasped;
  for (int i = 0; i < nodes.size(); ++i)
    if (on_surface(nodes.kinds[i]) && held[i] != all_axes && (nodes.positions[i] - grasp_->place).norm() <= reach &&
        (model.incision == nullptr || !model.incision->blocks(inside, nodes.positions[i])))
      grasped.push_back(i);
  if (grasped.empty())
    throw InputError(fmt::format("the grasper holds no free surface node: none within {:g} m of [{:.4g}, {:.4g}, "
                                 "{:.4g}] m; allowed: a place off the fixed regions, a larger tool.radius or finer "
                                 "nodes",
                                 reach, grasp_->place.x(), grasp_->place.y(), grasp_->place.z()));
  return grasped;
}

// Whether the piece that the grasper holds is severed from every fixed region.
bool Session::grasped_piece_is_free() const {
  const topology::Wound& wound = incisions_->wound();
  int piece = -1;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t) {
    if (wound.part[t] != topology::WoundPart::organ)
      continue;
    Vector3 middle = Vector3::Zero();
    for (const int vertex : wound.surface.triangles[t])
      middle += wound.surface.vertices[static_cast<std::size_t>(vertex)] / 3;
    if (const double distance = (middle - grasp_->place).squaredNorm(); distance < nearest) {
      nearest = distance;
      piece = wound.piece_of(static_cast<int>(t));
    }
  }
  const std::vector<int> unheld = unheld_pieces(wound, scenario_.fixed);
  return std::find(unheld.begin(), unheld.end(), piece) != unheld.end();
}

// Takes hold or lets go where its time has come; the body is then condensed onto the patch anew. True: it has let go.
bool Session::handle_grasper(const StepSample& sample) {
  if (!scenario_.tool || !scenario_.tool->grasp || !sample.tool)
    return false;
  const GraspSettings& settings = *scenario_.tool->grasp;
  const bool closed = grip_.value_or(sample.time >= settings.grasp && sample.time < settings.release);
  lost_grip_ = lost_grip_ && closed;
  const bool holds = closed && !lost_grip_;
  if (holds == grasp_.has_value())
    return false;
  if (!holds) {
    grasp_.reset();
    if (model_.body == nullptr)
      return false;
    condense({}, model_);
    solve(sample, model_);
    return true;
  }
  if (model_.body == nullptr)
    build(model_);
  if (!model_.state)
    solve_contact(nullptr, nullptr, scenario_, model_);
  Vector3 at_rest = sample.tool->point;
  try {
    at_rest = rest_position(at_rest);
  } catch (const NumericalError&) { // in front of the surface
  }
  Grasp grasp;
  grasp.place = organ_.domain->closest_surface_point(at_rest);
  grasp.normal = organ_.domain->normal(grasp.place);
  grasp.pose = *sample.tool;
  const double away = (grasp.place + model_.at(grasp.place).displacement - sample.tool->point).norm();
  if (const double reach = topology::tip_radius(scenario_.tool->shape); away > reach) { // led by a hand
    warn("grip", fmt::format("t = {:g} s: the grasper holds nothing, it is {:.3g} m from the surface; allowed: within "
                             "tool.radius = {:g} m",
                             sample.time, away, reach));
    return false;
  }
  grasp_ = std::move(grasp);
  const std::vector<int> nodes = grasped_nodes(model_);
  // Were they exchanged behind a tear, the patch would grow or shrink by a share of the surface, and do work of its
  // own.
  const solvers::NodeCloud& cloud = model_.sprinkling.nodes;
  const double about = topology::tip_radius(scenario_.tool->shape) + kept_about * zone_.spacing.fine;
  for (int i = 0; i < cloud.size(); ++i)
    if (on_surface(cloud.kinds[i]) && (cloud.positions[i] - grasp_->place).norm() <= about)
      grasp_->nodes.push_back({cloud.positions[i], cloud.kinds[i]});
  const solvers::Field before = model_.field;
  condense(nodes, model_);
  const MatrixX moved = model_.body->contact_displacements(nodes, {before});
  for (std::size_t c = 0; c < nodes.size(); ++c) {
    grasp_->rest.push_back(model_.patch.rest[c]);
    grasp_->displacement.emplace_back(moved.col(0).segment<3>(3 * static_cast<Eigen::Index>(c)));
  }
  solve(sample, model_);
  return false;
}

// Displacements that the grasper gives to the patch of a model: those in which it took hold, and its own way since.
std::vector<Vector3> Session::grasped_displacements(const topology::ToolPose& pose, const BodyModel& model) const {
  std::vector<Vector3> displacements;
  for (const Vector3& x : model.patch.rest) {
    const auto nearest =
        std::min_element(grasp_->rest.begin(), grasp_->rest.end(), [&](const Vector3& a, const Vector3& b) {
          return (a - x).squaredNorm() < (b - x).squaredNorm();
        });
    displacements.emplace_back(grasp_->displacement[static_cast<std::size_t>(nearest - grasp_->rest.begin())] +
                               pose.point - grasp_->pose.point);
  }
  return displacements;
}

} // namespace spherecut::app
