#include "src/tissue/grasping.hpp"

#include "src/tissue/cut_checks.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <utility>

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

Grasping::Change Grasping::change_at(const StepSample& sample, const std::optional<bool>& grip) {
  if (!scenario_.tool || !scenario_.tool->grasp || !sample.tool)
    return Change::none;
  const GraspSettings& settings = *scenario_.tool->grasp;
  const bool closed = grip.value_or(sample.time >= settings.grasp && sample.time < settings.release);
  lost_ = lost_ && closed;
  const bool wants = closed && !lost_;
  return wants == holds() ? Change::none : wants ? Change::closes : Change::opens;
}

std::vector<int> Grasping::nodes_between(const Grasp& grasp, const BodyModel& model, double fine) const {
  const solvers::NodeCloud& nodes = model.sprinkling.nodes;
  const std::vector<std::array<bool, 3>> held = held_axes(fixed_nodes(scenario_, domain_, nodes), nodes.size());
  const double reach = topology::tip_radius(scenario_.tool->shape);
  const Vector3 inside = grasp.place - 1e-3 * fine * grasp.normal;
  std::vector<int> grasped;
  for (int i = 0; i < nodes.size(); ++i)
    if (on_surface(nodes.kinds[i]) && held[i] != all_axes && (nodes.positions[i] - grasp.place).norm() <= reach &&
        (model.incision == nullptr || !model.incision->blocks(inside, nodes.positions[i])))
      grasped.push_back(i);
  if (grasped.empty())
    throw InputError(fmt::format("the grasper holds no free surface node: none within {:g} m of [{:.4g}, {:.4g}, "
                                 "{:.4g}] m; allowed: a place off the fixed regions, a larger tool.radius or finer "
                                 "nodes",
                                 reach, grasp.place.x(), grasp.place.y(), grasp.place.z()));
  return grasped;
}

// Were nodes about the patch exchanged behind a tear, the patch would grow or shrink by a share of the surface, and do
// work of its own.
Grasp Grasping::reach_for(const Vector3& at_rest, const topology::ToolPose& pose, const BodyModel& model,
                          double fine) const {
  Grasp grasp;
  grasp.place = domain_.closest_surface_point(at_rest);
  grasp.normal = domain_.normal(grasp.place);
  grasp.pose = pose;
  const solvers::NodeCloud& cloud = model.sprinkling.nodes;
  const double about = topology::tip_radius(scenario_.tool->shape) + kept_about * fine;
  for (int i = 0; i < cloud.size(); ++i)
    if (on_surface(cloud.kinds[i]) && (cloud.positions[i] - grasp.place).norm() <= about)
      grasp.nodes.push_back({cloud.positions[i], cloud.kinds[i]});
  return grasp;
}

std::optional<std::string> Grasping::miss(const Grasp& grasp, const StepSample& sample, const BodyModel& model) const {
  const double away = (grasp.place + model.at(grasp.place).displacement - sample.tool->point).norm();
  const double reach = topology::tip_radius(scenario_.tool->shape);
  if (away <= reach)
    return std::nullopt;
  return fmt::format("t = {:g} s: the grasper holds nothing, it is {:.3g} m from the surface; allowed: within "
                     "tool.radius = {:g} m",
                     sample.time, away, reach);
}

std::vector<Vector3> Grasping::displacements(const topology::ToolPose& pose, const BodyModel& model) const {
  std::vector<Vector3> given;
  for (const Vector3& x : model.patch.rest) {
    const auto nearest =
        std::min_element(grasp_->rest.begin(), grasp_->rest.end(), [&](const Vector3& a, const Vector3& b) {
          return (a - x).squaredNorm() < (b - x).squaredNorm();
        });
    given.emplace_back(grasp_->displacement[static_cast<std::size_t>(nearest - grasp_->rest.begin())] + pose.point -
                       grasp_->pose.point);
  }
  return given;
}

bool Grasping::piece_is_free(const topology::Wound& wound) const {
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

Grasp Grasping::lose() {
  lost_ = true;
  Grasp lost = std::move(*grasp_);
  grasp_.reset();
  return lost;
}

void Grasping::take_back(Grasp grasp) {
  grasp_ = std::move(grasp);
  lost_ = false;
}

FirstTouch find_grasp(const Scenario& scenario, const topology::Domain& domain, const std::vector<ToolSample>& motion,
                      bool on_path) {
  const GraspSettings& settings = *scenario.tool->grasp;
  FirstTouch touch;
  while (touch.sample + 1 < motion.size() && motion[touch.sample].time < settings.grasp)
    ++touch.sample;
  touch.pose = motion[touch.sample].pose;
  touch.contact = grasped_place(domain, touch.pose.point);
  const double reach = topology::tip_radius(scenario.tool->shape);
  const Vector3& x = touch.pose.point;
  if (const double away = (touch.contact.point - x).norm(); away > reach && on_path)
    throw InputError(fmt::format("{}:{}: the grasper cannot reach the organ: when it takes hold, at t = {:g} s, it is "
                                 "at [{:.4g}, {:.4g}, {:.4g}] m, {:.3g} m from the surface at [{:.4g}, {:.4g}, "
                                 "{:.4g}] m; allowed: within tool.radius = {:g} m",
                                 scenario.file.string(), scenario.tool->line, motion[touch.sample].time, x.x(), x.y(),
                                 x.z(), away, touch.contact.point.x(), touch.contact.point.y(), touch.contact.point.z(),
                                 reach));
  return touch;
}

} // namespace spherecut::app
