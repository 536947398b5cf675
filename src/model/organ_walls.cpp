#include "src/model/organ_walls.hpp"

#include "src/model/wall_bending.hpp"
#include "topology/incision/gap_walls.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numeric>

namespace spherecut::app {
namespace {

constexpr double spacings_through = 2; // of three nodes

std::string place_text(const Vector3& x) {
  return fmt::format("[{:.4g}, {:.4g}, {:.4g}] m", x.x(), x.y(), x.z());
}

std::optional<WidthAt> least_parallel(const std::vector<topology::WidthSample>& samples) {
  std::optional<WidthAt> least;
  for (const topology::WidthSample& sample : samples)
    if (sample.is_parallel && (!least || sample.width < least->width))
      least = WidthAt{sample.width, sample.point};
  return least;
}

/// Greatest local spacing among places, m: a wall that is thinner than twice that may lack nodes.
double largest_spacing(const std::vector<topology::WidthSample>& samples, const solvers::SpacingField& spacing) {
  double largest = 0;
  for (const topology::WidthSample& sample : samples)
    largest = std::max(largest, spacing(sample.point));
  return largest;
}

} // namespace

OrganWalls measure_walls(const topology::Domain& domain, double apart, double reach) {
  OrganWalls walls;
  walls.widths = topology::surface_widths(domain.surface(), apart, reach);
  walls.thinnest = least_parallel(walls.widths.walls);
  walls.narrowest = least_parallel(walls.widths.gaps);
  std::vector<topology::WidthSample> sorted = walls.widths.walls;
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.width < b.width; });
  const double whole = std::accumulate(sorted.begin(), sorted.end(), 0.0,
                                       [](double sum, const auto& sample) { return sum + sample.area; });
  double passed = 0;
  for (const topology::WidthSample& sample : sorted)
    if ((passed += sample.area) >= 0.5 * whole) {
      walls.median = sample.width;
      break;
    }
  return walls;
}

std::string walls_text(const OrganWalls& walls) {
  std::string text = fmt::format("thickness: {:.3g} mm in the middle", 1e3 * walls.median);
  if (walls.thinnest)
    text += fmt::format(", walls from {:.3g} mm at {}", 1e3 * walls.thinnest->width, place_text(walls.thinnest->place));
  if (walls.narrowest)
    text +=
        fmt::format("; gaps from {:.3g} mm at {}", 1e3 * walls.narrowest->width, place_text(walls.narrowest->place));
  return text;
}

void follow_walls(const OrganWalls& walls, const topology::Domain& domain, int budget, solvers::SpacingField& spacing) {
  const std::vector<topology::WidthSample>& samples = walls.widths.walls;
  // The finer the spacing, the thinner a place has to be to count: from the coarse one down.
  double wanted = spacing.coarse;
  for (const int s : topology::thin_samples(samples, spacings_through * spacing.coarse))
    wanted = std::min(wanted, samples[s].width / spacings_through);
  if (wanted >= spacing.coarse)
    return;
  solvers::SpacingField followed = spacing;
  const auto count_at = [&](double coarse) {
    followed.coarse = coarse;
    followed.fine = std::min(spacing.fine, coarse);
    return solvers::expected_count(domain, followed);
  };
  double upper = spacing.coarse; // a spacing that is within the budget, or the one that there was
  if (count_at(wanted) <= budget) {
    upper = wanted;
  } else {
    double lower = wanted;
    for (int step = 0; step < 8 && upper > 1.02 * lower; ++step) {
      const double middle = std::sqrt(lower * upper);
      (count_at(middle) > budget ? lower : upper) = middle;
    }
  }
  spacing.coarse = upper;
  spacing.fine = std::min(spacing.fine, upper);
}

std::optional<CoarseWall> coarsest_wall(const OrganWalls& walls, const solvers::SpacingField& spacing,
                                        double most_through) {
  const std::vector<topology::WidthSample>& samples = walls.widths.walls;
  constexpr double rounding = 1.02; // a spacing that was derived from the wall does
  const double largest = largest_spacing(samples, spacing);
  std::optional<CoarseWall> worst;
  // First walls of less than one spacing, as wide as that has to be to tell a wall from a margin; then the others.
  for (const double through : {1.0, most_through}) {
    for (const int s : topology::thin_samples(samples, through * largest)) {
      const double h = spacing(samples[s].point);
      const CoarseWall wall{samples[s].width, h, samples[s].point, samples[s].width / most_through};
      const bool counts = wall.thickness * rounding < through * h && (through == 1 || wall.thickness >= h);
      if (counts && (!worst || wall.nodes_through() < worst->nodes_through()))
        worst = wall;
    }
    if (worst)
      break;
  }
  return worst;
}

std::optional<WidthAt> stiff_gap(const OrganWalls& walls, const solvers::SpacingField& spacing) {
  double area = 0; // in squared spacings
  std::optional<WidthAt> narrowest;
  for (const topology::WidthSample& gap : walls.widths.gaps) {
    const double h = spacing(gap.point);
    if (!gap.is_parallel || gap.width < 0.5 * h || gap.width > topology::widest_gap * h)
      continue;
    area += gap.area / (h * h);
    if (!narrowest || gap.width < narrowest->width)
      narrowest = WidthAt{gap.width, gap.point};
  }
  return area >= topology::least_gap_area ? narrowest : std::nullopt;
}

std::string bending_error(double nodes_through, solvers::Method method) {
  if (nodes_through < 1)
    return "with less than one spacing through it, it has no stiffness in bending and moves by many times too much";
  // Percent by which a rod of square section, nu = 0.3, bends too little under its own weight, against the beam's
  // theory with shear, at 1, 1.5, 2, 2.5 and 3 spacings through it.
  constexpr std::array<double, 5> galerkin{13.6, 6.7, 3.2, 2.6, 1.8}, collocation{61, 25, 22, 10, 9.8};
  const std::array<double, 5>& measured = method == solvers::Method::galerkin ? galerkin : collocation;
  const double place = std::clamp(2 * (nodes_through - 1), 0.0, 4.0);
  const int below = std::min(3, static_cast<int>(place));
  const double percent = measured[below] + (place - below) * (measured[below + 1] - measured[below]);
  return fmt::format("with {:.2g} spacings through it, it bends by about {:.0f} % too little (method {})",
                     nodes_through, percent, solvers::to_string(method));
}

} // namespace spherecut::app
