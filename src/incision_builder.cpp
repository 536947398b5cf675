#include "src/incision_builder.hpp"

#include "topology/cut_sheets.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

topology::SurfaceMesh sheet_of(const PrecutSettings& precut, double edge) {
  // A sheet smaller than the triangles wanted gets four of them across.
  if (const auto* disc = std::get_if<DiscSheet>(&precut.shape))
    return topology::make_disc_sheet(disc->centre, disc->normal, disc->radius, std::min(edge, disc->radius / 2));
  if (const auto* rectangle = std::get_if<RectangleSheet>(&precut.shape))
    return topology::make_rectangle_sheet(rectangle->centre, rectangle->normal, rectangle->up, rectangle->width,
                                          rectangle->height,
                                          std::min({edge, rectangle->width / 4, rectangle->height / 4}));
  if (const auto* polygon = std::get_if<PolygonSheet>(&precut.shape)) {
    for (std::size_t i = 0; i < polygon->points.size(); ++i)
      edge = std::min(edge, (polygon->points[i] - polygon->points[(i + 1) % polygon->points.size()]).norm());
    return topology::make_polygon_sheet(polygon->points, edge);
  }
  const auto& file = std::get<SheetFile>(precut.shape);
  return topology::read_sheet(file.file, file.scale);
}

} // namespace

IncisionBuilder::IncisionBuilder(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain, double edge)
    : domain_(std::move(domain)), wound_(std::make_unique<topology::IncrementalWound>(domain_->surface())),
      fields_(std::make_unique<topology::CutFields>(edge)) {
  for (const PrecutSettings& precut : scenario.precuts) {
    try { // one at a time, so that an unusable sheet is told with its line
      earlier_.push_back(sheet_of(precut, edge));
      incision_ = std::make_shared<const topology::Incision>(earlier_, domain_, revision_);
      wound_->grow(earlier_);
    } catch (const InputError& error) {
      throw InputError(
          fmt::format("{}:{}: precut[{}]: {}", scenario.file.string(), precut.line, earlier_.size(), error.what()));
    }
  }
  if (!scenario.blade)
    return;
  blade_ = topology::Blade{scenario.blade->edge, scenario.blade->edge_radius};
  options_.edge = edge;
  try {
    start_blade();
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}:{}: {}", scenario.file.string(), scenario.blade->line, error.what()));
  }
}

void IncisionBuilder::start_blade() {
  sweep_ = std::make_unique<topology::BladeSweep>(*blade_, domain_, options_);
}

std::vector<topology::SurfaceMesh> IncisionBuilder::sheets() const {
  std::vector<topology::SurfaceMesh> all = earlier_;
  if (sweep_ != nullptr) {
    const std::vector<topology::SurfaceMesh> swept = sweep_->sheets();
    all.insert(all.end(), swept.begin(), swept.end());
  }
  return all;
}

topology::SweepResult IncisionBuilder::move_to(const topology::BladePose& pose, const topology::RestMap& to_rest) {
  sheets_before_ = sheets();
  incision_before_ = incision_;
  topology::SweepResult swept = sweep_->move_to(pose, to_rest);
  if (swept.triangles == 0)
    return swept;
  try {
    const std::vector<topology::SurfaceMesh> grown = sheets();
    incision_ = std::make_shared<const topology::Incision>(grown, domain_, ++revision_);
    wound_->grow(grown);
  } catch (...) {
    take_back(pose, to_rest);
    throw;
  }
  return swept;
}

void IncisionBuilder::update_fields() {
  if (incision_ != nullptr)
    fields_->update(incision_);
}

void IncisionBuilder::take_back(const topology::BladePose& pose, const topology::RestMap& to_rest) {
  incision_ = incision_before_;
  earlier_ = sheets_before_;
  auto wound = std::make_unique<topology::IncrementalWound>(domain_->surface());
  if (!earlier_.empty())
    wound->grow(earlier_);
  wound_ = std::move(wound);
  if (incision_ != nullptr)
    fields_->update(incision_);
  else
    fields_ = std::make_unique<topology::CutFields>(options_.edge);
  start_blade();
  sweep_->move_to(pose, to_rest);
}

} // namespace spherecut::app
