#include "src/model/incision_builder.hpp"

#include "src/model/precut_sheets.hpp"
#include "src/scenario/schedule.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/sheet_front.hpp"
#include "topology/wound/splinters.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double same_edge_place = 1e-6; // edges: nearer to the pose before it a pose is the same
constexpr double straight = 2e-3;        // edges: a way is, where no pose put off is farther from it
constexpr double near_surface = 0.02;    // edges, two of which are a spacing: a sheet's end so near to it is on it
// Edges: strips whose distance is below a quarter are one place to a sweep. What such strips leave between them in wavy
// strokes of 59 seeds, the body moving by up to 0.2 edges between two increments, had up to 0.126.
constexpr double thinnest = 0.25;
constexpr double least_overlap = 1e-3; // of a sheet on another: less may be a triangle beside the line where they cross

/// Part of a sheet's area that lies on the cut so far, 0 to 1, looked at every `edge` m.
double share_on(const topology::Incision& cut, const topology::SurfaceMesh& sheet, double edge) {
  constexpr double near = 1e-3, same_way = 0.999; // edges; a cosine
  double whole = 0, on = 0;
  for (const Triangle& triangle : sheet.triangles) {
    const Vector3 &a = sheet.vertices[triangle[0]], ab = sheet.vertices[triangle[1]] - a,
                  ac = sheet.vertices[triangle[2]] - a;
    const Vector3 normal = ab.cross(ac).normalized();
    const int parts = static_cast<int>(std::ceil(std::max({ab.norm(), ac.norm(), (ac - ab).norm()}) / edge));
    const double area = 0.5 * ab.cross(ac).norm() / (parts * parts);
    const auto look = [&](double u, double v) {
      const auto face = cut.closest(a + u / parts * ab + v / parts * ac, near * edge);
      whole += area;
      on += face && std::abs(face->normal.dot(normal)) > same_way ? area : 0;
    };
    for (int i = 0; i < parts; ++i)
      for (int k = 0; i + k < parts; ++k) {
        look(i + 1.0 / 3, k + 1.0 / 3);
        if (i + k + 1 < parts) // the one that stands on its head
          look(i + 2.0 / 3, k + 2.0 / 3);
      }
  }
  return whole > 0 ? on / whole : 0;
}

} // namespace

IncisionBuilder::IncisionBuilder(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain, double edge)
    : domain_(std::move(domain)), wound_(std::make_unique<topology::IncrementalWound>(domain_->surface())),
      fields_(std::make_unique<topology::CutFields>(edge)) {
  options_.edge = edge;
  if (scenario.blade) {
    blade_ = topology::Blade{scenario.blade->edge, scenario.blade->edge_radius};
    try {
      sweep_.emplace(*blade_, domain_, options_);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}:{}: {}", scenario.file.string(), scenario.blade->line, error.what()));
    }
  }
  for (std::size_t k = 0; k < scenario.precuts.size(); ++k) {
    const PrecutSettings& precut = scenario.precuts[k];
    try { // one at a time, so that an unusable sheet is told with its line
      std::vector<std::string> said;
      topology::SurfaceMesh sheet = precut_sheet(precut, *domain_, edge, &said);
      topology::check_sheet(sheet, "its sheet"); // before the incision does, which counts sheets from 0
      if (const int moved = end_on_surface(sheet, *domain_, near_surface * edge); moved > 0)
        said.push_back(fmt::format("its sheet ended less than {:.2g} mm below the surface at {} vertices: it is cut "
                                   "through to the surface there",
                                   1e3 * near_surface * edge, moved));
      for (const std::string& remark : said)
        remarks_.push_back(fmt::format("precut[{}]: {}", k + 1, remark));
      if (!topology::reaches_inside(sheet, *domain_))
        throw InputError(
            fmt::format("lies outside the organ: no point of its {} triangles is inside", sheet.triangles.size()));
      if (const double share = incision_ ? share_on(*incision_, sheet, edge) : 0; share > least_overlap)
        throw InputError(
            fmt::format("{:.3g} % of its area lie on the precuts before it; allowed: none, sheets may only "
                        "cross",
                        100 * share));
      add(std::move(sheet));
      use(sheets());
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}:{}: precut[{}]: {}", scenario.file.string(), precut.line, k + 1, error.what()));
    }
  }
}

std::vector<topology::SurfaceMesh> IncisionBuilder::sheets() const {
  return sweep_ ? sweep_->sheets() : own_;
}

void IncisionBuilder::add(topology::SurfaceMesh sheet) {
  if (sweep_)
    sweep_->add(sheet);
  else
    own_.push_back(std::move(sheet));
}

void IncisionBuilder::use(const std::vector<topology::SurfaceMesh>& sheets) {
  incision_ = std::make_shared<const topology::Incision>(sheets, domain_, ++revision_);
  grow(sheets);
}

void IncisionBuilder::grow(const std::vector<topology::SurfaceMesh>& sheets) {
  wound_->grow(sheets);
  mended_ = topology::without_splinters(wound_->wound(), thinnest * options_.edge);
}

bool IncisionBuilder::is_outside(const topology::BladePose& pose, const topology::RestMap& to_rest) const {
  for (std::size_t i = 1; i < blade_->edge.size(); ++i) {
    const Vector3 along = blade_->edge[i] - blade_->edge[i - 1];
    const int parts = std::max(1, static_cast<int>(std::ceil(along.norm() / options_.edge)));
    for (int k = 0; k <= parts; ++k) {
      const Vector3 x = pose.orientation * (blade_->edge[i - 1] + along * k / parts) + pose.position;
      if (domain_->signed_distance(to_rest ? to_rest(x) : x) < options_.edge)
        return false;
    }
  }
  return true;
}

topology::SweepResult IncisionBuilder::move_to(const topology::BladePose& pose, const topology::RestMap& to_rest,
                                               std::optional<topology::Wound>* wound_before) {
  std::erase_if(missed_, [&](const topology::BladePose& missed) { return missed.time >= pose.time; });
  before_ = mark();
  before_.missed.push_back(pose);
  try {
    if (refused_ && !missed_.empty() && is_outside(missed_.back(), to_rest))
      place(topology::BladePose(missed_.back()), to_rest);
    std::vector<topology::BladePose> way = missed_;
    way.push_back(pose);
    if (at_)
      way = without_straight(blade_->edge, *at_, way, straight * options_.edge);
    topology::SweepResult last;
    int triangles = 0;
    for (const topology::BladePose& next : way) {
      last = sweep_->move_to(next, to_rest);
      triangles += last.triangles;
    }
    at_ = pose;
    missed_.clear();
    refused_ = false;
    last.triangles = triangles;
    if (last.triangles == 0)
      return last;
    if (wound_before != nullptr)
      *wound_before = wound();
    use(sheets());
    return last;
  } catch (...) {
    take_back();
    throw;
  }
}

void IncisionBuilder::put_off(const topology::BladePose& pose) {
  const std::optional<topology::BladePose> last = missed_.empty() ? at_ : missed_.back();
  if (last && edge_travel(blade_->edge, *last, pose) <= same_edge_place * options_.edge) // however long it rests
    return;
  missed_.push_back(pose);
  before_.missed.push_back(pose); // taking the last motion back leaves it
}

void IncisionBuilder::update_fields() {
  if (incision_ != nullptr)
    fields_->update(incision_);
}

void IncisionBuilder::place(const topology::BladePose& pose, const topology::RestMap& to_rest) {
  missed_.clear();
  refused_ = false;
  sweep_->lift();
  sweep_->move_to(pose, to_rest);
  at_ = pose;
}

void IncisionBuilder::tear(const std::vector<topology::SurfaceMesh>& grown) {
  before_ = mark();
  try {
    if (const std::size_t count = sheets().size(); grown.size() != count)
      throw InputError(fmt::format("a tear of {} sheets in a cut of {}", grown.size(), count));
    if (!sweep_)
      own_ = grown;
    for (std::size_t s = 0; sweep_ && s < grown.size(); ++s)
      sweep_->extend(static_cast<int>(s), grown[s]);
    use(grown);
  } catch (...) {
    take_back();
    throw;
  }
}

void IncisionBuilder::seed(topology::SurfaceMesh sheet) {
  before_ = mark();
  try {
    add(std::move(sheet));
    use(sheets());
  } catch (...) {
    take_back();
    throw;
  }
}

void IncisionBuilder::go_back(const Mark& mark) {
  before_ = mark;
  take_back();
}

void IncisionBuilder::take_back() {
  const bool grew = incision_ != before_.incision;
  incision_ = before_.incision;
  own_ = before_.own;
  sweep_ = before_.sweep;
  at_ = before_.at;
  missed_ = before_.missed;
  refused_ = true;
  if (!grew)
    return;
  wound_ = std::make_unique<topology::IncrementalWound>(domain_->surface());
  mended_.reset();
  if (!before_.sheets.empty())
    grow(before_.sheets);
  if (incision_ != nullptr)
    fields_->update(incision_);
  else
    fields_ = std::make_unique<topology::CutFields>(options_.edge);
}

} // namespace spherecut::app
