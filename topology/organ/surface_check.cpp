#include "topology/organ/surface_check.hpp"

#include "topology/base/errors.hpp"
#include "topology/organ/surface_mending.hpp"
#include "topology/surface/parting.hpp"
#include "topology/surface/pieces.hpp"
#include "topology/surface/self_intersections.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

namespace spherecut::topology {

namespace {

constexpr int shown_elements = 3; // offending elements that a message lists
constexpr int filled = -1;        // source of triangles that close a hole
constexpr int small_hole_edges = 12;
constexpr double small_hole_perimeter = 0.2; // of the square root of the area
constexpr double no_volume = 1e-9;           // of the cube of the size

constexpr std::size_t parted_pairs = 20;  // pairs of triangles that may be parted
constexpr double parted_movement = 0.005; // of the bounding box's diagonal, to part them

/// One side of a triangle: the edge low < high, and whether the triangle runs from low to high.
struct Side {
  int low, high, triangle;
  bool rising;
};

class Checker {
 public:
  Checker(const PolygonSoup& soup, std::string name, const SurfaceChoices& choices = {})
      : soup_(soup), name_(std::move(name)), choices_(choices) {
    mesh_.vertices = soup.vertices;
    diagonal_ = bounds(mesh_).extent().norm();
  }

  CheckedSurface run() {
    require_readable(soup_, name_);
    if (soup_.polygons.empty())
      refuse("there are no faces");
    require_three_dimensions();
    make_triangles();
    remove_repeated_triangles();
    part(PartedBy::material);
    orient(sorted_sides());
    choose_components();
    say_turned();
    fill_small_holes();
    mend_slivers();
    require_volume();
    part_self_intersections();
    remove_unused_vertices(mesh_);
    warn_about_size();
    result_.mesh = std::move(mesh_);
    return std::move(result_);
  }

  CheckedSurface run_sheet() {
    require_readable(soup_, name_);
    if (soup_.polygons.empty())
      refuse("there are no faces");
    if (!std::isfinite(diagonal_))
      refuse("coordinates are too large to compute with: their squares are not finite");
    make_triangles();
    remove_repeated_triangles();
    part(PartedBy::flatness);
    orient(sorted_sides());
    for (std::size_t t = 0; t < turn_.size(); ++t)
      turned_ += turn_[t] == Turn::flip ? 1 : 0;
    if (turned_ > 0)
      result_.mended.push_back(
          fmt::format("turned {} of {} triangles, whose orientation was inconsistent", turned_, turn_.size()));
    if (const int operations = remove_slivers(mesh_, source_); operations > 0)
      result_.mended.push_back(fmt::format("removed slivers by {} collapses and flips of edges", operations));
    remove_unused_vertices(mesh_);
    result_.mesh = std::move(mesh_);
    return std::move(result_);
  }

 private:
  [[noreturn]] void refuse(const std::string& defect) const { throw InputError(name_ + ": " + defect); }

  [[nodiscard]] std::string vertex(int v) const {
    const Vector3& x = mesh_.vertices[v];
    return fmt::format("vertex {} ({:.6g}, {:.6g}, {:.6g})", v, x.x(), x.y(), x.z());
  }

  [[nodiscard]] std::string face(int triangle) const {
    if (source_[triangle] == filled)
      return "a filled hole";
    const Triangle& t = mesh_.triangles[triangle];
    const Vector3 x = (mesh_.vertices[t[0]] + mesh_.vertices[t[1]] + mesh_.vertices[t[2]]) / 3;
    return fmt::format("face {} at ({:.6g}, {:.6g}, {:.6g})", source_[triangle], x.x(), x.y(), x.z());
  }

  /// The first few offending elements, and how many more there are.
  static std::string listed(const std::vector<std::string>& elements) {
    std::string text;
    for (int i = 0; i < std::min<int>(shown_elements, static_cast<int>(elements.size())); ++i)
      text += (i > 0 ? "; " : "") + elements[i];
    if (std::ssize(elements) > shown_elements)
      text += fmt::format("; and {} more", std::ssize(elements) - shown_elements);
    return text;
  }

  void require_three_dimensions() const {
    if (!std::isfinite(diagonal_))
      refuse("coordinates are too large to compute with: their squares are not finite");
    Vector3 mean = Vector3::Zero();
    for (const Vector3& v : mesh_.vertices)
      mean += v / static_cast<double>(mesh_.vertices.size());
    Matrix3 covariance = Matrix3::Zero();
    for (const Vector3& v : mesh_.vertices)
      covariance += (v - mean) * (v - mean).transpose() / static_cast<double>(mesh_.vertices.size());
    const Vector3 spread = Eigen::SelfAdjointEigenSolver<Matrix3>(covariance, Eigen::EigenvaluesOnly).eigenvalues();
    const double thickness = std::sqrt(std::max(0.0, spread[0]));
    if (thickness <= 1e-6 * diagonal_)
      refuse(
          fmt::format("all vertices lie in one plane (thickness {:.3g} m of an extent of {:.3g} m): there is no body",
                      thickness, diagonal_));
  }

  void make_triangles() {
    const std::vector<int> first = coinciding_vertices(mesh_.vertices, 1e-7 * diagonal_);
    std::vector<bool> used(first.size(), false);
    for (const std::vector<int>& polygon : soup_.polygons)
      for (const int v : polygon)
        used[v] = true;
    int joined = 0, unused = 0;
    for (int v = 0; v < std::ssize(first); ++v) {
      joined += used[v] && first[v] != v;
      unused += !used[v];
    }
    if (joined > 0)
      result_.mended.push_back(fmt::format("joined {} vertices to others at the same place", joined));
    if (unused > 0)
      result_.mended.push_back(fmt::format("removed {} vertices that no face uses", unused));
    int collapsed = 0, cut = 0;
    for (int f = 0; f < std::ssize(soup_.polygons); ++f) {
      std::vector<int> corners;
      for (const int v : soup_.polygons[f])
        if (corners.empty() || corners.back() != first[v])
          corners.push_back(first[v]);
      if (corners.size() > 1 && corners.front() == corners.back())
        corners.pop_back();
      if (corners.size() < 3) {
        ++collapsed;
        continue;
      }
      if (corners.size() == 3) {
        add({corners[0], corners[1], corners[2]}, f);
        continue;
      }
      ++cut;
      std::vector<Vector3> positions;
      positions.reserve(corners.size());
      for (const int v : corners)
        positions.push_back(mesh_.vertices[v]);
      for (const auto& [a, b, c] : triangulate_polygon(positions))
        add({corners[a], corners[b], corners[c]}, f);
    }
    if (collapsed > 0)
      result_.mended.push_back(fmt::format("removed {} faces with fewer than three different corners", collapsed));
    if (cut > 0)
      result_.mended.push_back(fmt::format("cut {} polygons of four or more corners into triangles", cut));
    if (mesh_.triangles.empty())
      refuse("no face has three different corners");
  }

  void add(const Triangle& triangle, int face_number) {
    mesh_.triangles.push_back(triangle);
    source_.push_back(face_number);
  }

  void remove_repeated_triangles() {
    std::set<Triangle> seen;
    std::size_t kept = 0;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      Triangle sorted = mesh_.triangles[t];
      std::sort(sorted.begin(), sorted.end());
      if (!seen.insert(sorted).second)
        continue;
      source_[kept] = source_[t];
      mesh_.triangles[kept++] = mesh_.triangles[t];
    }
    if (kept < mesh_.triangles.size())
      result_.mended.push_back(fmt::format("removed {} faces that repeat others", mesh_.triangles.size() - kept));
    mesh_.triangles.resize(kept);
    source_.resize(kept);
  }

  [[nodiscard]] std::vector<Side> sorted_sides() const {
    std::vector<Side> sides;
    sides.reserve(3 * mesh_.triangles.size());
    for (int t = 0; t < std::ssize(mesh_.triangles); ++t)
      for (int e = 0; e < 3; ++e) {
        const int a = mesh_.triangles[t][e], b = mesh_.triangles[t][(e + 1) % 3];
        sides.push_back({std::min(a, b), std::max(a, b), t, a < b});
      }
    std::sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) {
      return std::tie(p.low, p.high, p.triangle) < std::tie(q.low, q.high, q.triangle);
    });
    return sides;
  }

  /// Calls visit(first, last) for the sides of each edge.
  template <typename Visit>
  static void for_each_edge(const std::vector<Side>& sides, Visit visit) {
    for (std::size_t i = 0; i < sides.size();) {
      std::size_t j = i;
      while (j < sides.size() && sides[j].low == sides[i].low && sides[j].high == sides[i].high)
        ++j;
      visit(i, j);
      i = j;
    }
  }

  void part(PartedBy by) {
    const Parting parting = part_surface(mesh_, source_, by);
    std::vector<std::string> bad;
    for (const AmbiguousEdge& edge : parting.ambiguous)
      bad.push_back(fmt::format("the edge from {} to {} has {} faces, among them {}", vertex(edge.low),
                                vertex(edge.high), edge.faces, source_[edge.triangle]));
    if (!bad.empty())
      refuse(
          fmt::format("not a 2-manifold: {}; these faces do not bound material and void in turn, so that they cannot "
                      "be parted",
                      listed(bad)));
    if (parting.edges > 0 || parting.vertices > 0)
      result_.mended.push_back(
          fmt::format("parted the surface at {} edges with more than two faces and at {} vertices where parts of it "
                      "touched, by moving copies up to {:.2g} mm",
                      parting.edges, parting.vertices, 1e3 * parting.movement));
  }

  /// Turns the triangles so that neighbours agree with the first triangle of their component.
  void orient(const std::vector<Side>& sides) {
    struct Link {
      int triangle;
      bool agrees;
    };
    std::vector<std::vector<Link>> links(mesh_.triangles.size());
    for_each_edge(sides, [&](std::size_t first, std::size_t last) {
      if (last - first != 2)
        return;
      const Side &a = sides[first], &b = sides[first + 1];
      links[a.triangle].push_back({b.triangle, a.rising != b.rising});
      links[b.triangle].push_back({a.triangle, a.rising != b.rising});
    });
    std::vector<Turn>& turn = turn_;
    turn.assign(mesh_.triangles.size(), Turn::unknown);
    for (int seed = 0; seed < std::ssize(turn); ++seed) {
      if (turn[seed] != Turn::unknown)
        continue;
      turn[seed] = Turn::keep;
      std::vector<int> open = {seed};
      while (!open.empty()) {
        const int t = open.back();
        open.pop_back();
        for (const auto& [other, agrees] : links[t]) {
          const Turn wanted = agrees == (turn[t] == Turn::keep) ? Turn::keep : Turn::flip;
          if (turn[other] == Turn::unknown) {
            turn[other] = wanted;
            open.push_back(other);
          } else if (turn[other] != wanted) {
            refuse(fmt::format("the surface has one side only, like a Moebius strip: no orientation fits {} and {}",
                               face(t), face(other)));
          }
        }
      }
    }
    for (std::size_t t = 0; t < turn.size(); ++t)
      if (turn[t] == Turn::flip)
        std::swap(mesh_.triangles[t][1], mesh_.triangles[t][2]);
  }

  /// Keeps the pieces and cavities that are wanted, and turns them outwards and inwards.
  void choose_components() {
    const SurfaceComponents found = find_components(mesh_);
    const std::vector<SurfaceComponent>& all = found.components;
    std::vector<char> keep(all.size(), 1);
    std::vector<int> pieces, cavities;
    int flat = 0;
    for (int c = 0; c < std::ssize(all); ++c) {
      if (c > 0 && std::abs(all[c].volume) < no_volume * std::pow(all[c].box.extent().norm(), 3)) {
        keep[c] = 0;
        ++flat;
      } else {
        (all[c].is_cavity() ? cavities : pieces).push_back(c);
      }
    }
    if (flat > 0)
      result_.mended.push_back(fmt::format("left out {} parts of the surface that enclose no volume", flat));
    choose_pieces(all, pieces, keep);
    std::erase_if(cavities, [&](int c) { return keep[all[c].within.front()] == 0; });
    choose_cavities(all, cavities, keep);
    for (int c = 0; c < std::ssize(all); ++c) // what floats in a cavity that is filled, or in a piece left out
      for (const int outer : all[c].within)
        keep[c] = keep[c] != 0 && keep[outer] != 0 ? 1 : 0;
    turn_components(found, keep);
  }

  [[nodiscard]] std::string shown_component(const SurfaceComponent& component) const {
    return fmt::format("{:.3g} ml, {} triangles, about ({:.4g}, {:.4g}, {:.4g})", 1e6 * std::abs(component.volume),
                       component.triangles, component.middle.x(), component.middle.y(), component.middle.z());
  }

  void choose_pieces(const std::vector<SurfaceComponent>& all, const std::vector<int>& pieces,
                     std::vector<char>& keep) {
    if (pieces.size() < 2)
      return;
    double whole = 0, rest = 0;
    std::vector<std::string> places;
    for (const int c : pieces) {
      whole += std::abs(all[c].volume);
      rest += c == pieces.front() ? 0 : std::abs(all[c].volume);
      places.push_back(shown_component(all[c]));
    }
    switch (choices_.pieces) {
    case PieceChoice::refuse:
      refuse(
          fmt::format("the surface is in {} separate pieces: {}; organ.pieces = \"largest\" keeps the first, which has "
                      "{:.3g} % of the volume, \"all\" keeps every one",
                      pieces.size(), listed(places), 100 * (1 - rest / whole)));
    case PieceChoice::largest:
      for (std::size_t p = 1; p < pieces.size(); ++p)
        keep[pieces[p]] = 0;
      places.erase(places.begin());
      result_.mended.push_back(fmt::format("left out {} of {} separate pieces, {:.3g} % of the volume: {}",
                                           places.size(), pieces.size(), 100 * rest / whole, listed(places)));
      return;
    case PieceChoice::all:
      result_.warnings.push_back(
          fmt::format("{}: the body is in {} separate pieces: {}", name_, pieces.size(), listed(places)));
    }
  }

  void choose_cavities(const std::vector<SurfaceComponent>& all, const std::vector<int>& cavities,
                       std::vector<char>& keep) {
    if (cavities.empty())
      return;
    std::vector<std::string> places;
    places.reserve(cavities.size());
    for (const int c : cavities)
      places.push_back(shown_component(all[c]));
    const std::string found =
        fmt::format("{} closed {}: {}", cavities.size(), cavities.size() == 1 ? "cavity" : "cavities", listed(places));
    switch (choices_.cavities) {
    case CavityChoice::refuse:
      refuse(fmt::format("the body has {}; organ.cavities = \"keep\" keeps, \"fill\" fills them", found));
    case CavityChoice::fill:
      for (const int c : cavities)
        keep[c] = 0;
      result_.mended.push_back("filled " + found);
      return;
    case CavityChoice::keep:
      result_.warnings.push_back(fmt::format("{}: the body has {}", name_, found));
    }
  }

  /// Removes the triangles of components that are not kept; counts what is turned against the soup.
  void turn_components(const SurfaceComponents& found, const std::vector<char>& keep) {
    std::size_t kept = 0;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const SurfaceComponent& component = found.components[found.of[t]];
      if (keep[found.of[t]] == 0)
        continue;
      Triangle corners = mesh_.triangles[t];
      const bool is_turned = (component.volume < 0) != component.is_cavity();
      if (is_turned)
        std::swap(corners[1], corners[2]);
      const bool differs = is_turned != (turn_[t] == Turn::flip);
      (component.is_cavity() ? turned_in_ : turned_) += differs ? 1 : 0;
      oriented_ += component.is_cavity() ? 0 : 1;
      source_[kept] = source_[t];
      mesh_.triangles[kept++] = corners;
    }
    mesh_.triangles.resize(kept);
    source_.resize(kept);
  }

  void fill_small_holes() {
    const std::vector<std::vector<int>> loops = border_loops(mesh_);
    const double longest = small_hole_perimeter * std::sqrt(area(mesh_));
    std::vector<std::string> large;
    for (const std::vector<int>& loop : loops) {
      double perimeter = 0;
      for (std::size_t i = 0; i < loop.size(); ++i)
        perimeter += (mesh_.vertices[loop[i]] - mesh_.vertices[loop[(i + 1) % loop.size()]]).norm();
      if (loop.size() > small_hole_edges || perimeter > longest)
        large.push_back(fmt::format("a hole of {} edges and {:.4g} m around, at the edge from {} to {}", loop.size(),
                                    perimeter, vertex(loop[0]), vertex(loop[1])));
    }
    if (!large.empty())
      refuse(fmt::format("the surface is open: {} (filled are holes of up to {} edges and {:.4g} m); is the file "
                         "complete?",
                         listed(large), small_hole_edges, longest));
    for (const std::vector<int>& loop : loops) {
      std::vector<Vector3> corners;
      corners.reserve(loop.size());
      for (const int v : loop)
        corners.push_back(mesh_.vertices[v]);
      for (const auto& [a, b, c] : triangulate_polygon(corners))
        add({loop[a], loop[b], loop[c]}, filled);
    }
    if (loops.empty())
      return;
    for_each_edge(sorted_sides(), [&](std::size_t first, std::size_t last) {
      if (last - first != 2)
        refuse(fmt::format("a small hole at {} cannot be filled without leaving the surface's own edges crossed",
                           vertex(loops.front().front())));
    });
    std::vector<std::string> places;
    places.reserve(loops.size());
    for (const std::vector<int>& loop : loops)
      places.push_back(fmt::format("of {} edges at {}", loop.size(), vertex(loop[0])));
    result_.mended.push_back(
        fmt::format("filled {} small hole{}: {}", loops.size(), loops.size() == 1 ? "" : "s", listed(places)));
  }

  void mend_slivers() {
    if (const int operations = remove_slivers(mesh_, source_); operations > 0)
      result_.mended.push_back(fmt::format("removed slivers by {} collapses and flips of edges", operations));
    std::vector<std::string> flat;
    int slivers = 0;
    for (int t = 0; t < std::ssize(mesh_.triangles); ++t) {
      slivers += is_sliver(mesh_, mesh_.triangles[t]);
      if (!triangle_normal(mesh_, t).allFinite() || triangle_normal(mesh_, t).norm() < 0.5)
        flat.push_back(face(t));
    }
    if (!flat.empty())
      refuse("triangles without area that cannot be removed: " + listed(flat));
    if (slivers > 0)
      result_.warnings.push_back(fmt::format("{}: {} slivers remain", name_, slivers));
  }

  void require_volume() const {
    const double enclosed = volume(mesh_);
    if (!(enclosed >= no_volume * std::pow(diagonal_, 3)))
      refuse(fmt::format("the surface encloses no volume ({:.3g} m3)", enclosed));
  }

  void say_turned() {
    if (turned_ > 0 && turned_ == oriented_)
      result_.mended.push_back("turned the whole surface outwards: it was inside out");
    else if (turned_ > 0)
      result_.mended.push_back(
          fmt::format("turned {} of {} triangles, whose orientation was inconsistent, outwards", turned_, oriented_));
    if (turned_in_ > 0)
      result_.mended.push_back(fmt::format("turned {} triangles towards the cavities that they bound", turned_in_));
  }

  /// Walls of a thin fold that just pass each other are parted by evening out their vertices; anything more is refused.
  void part_self_intersections() {
    const auto pairs = self_intersections(mesh_);
    if (pairs.empty())
      return;
    std::vector<std::string> bad;
    bad.reserve(pairs.size());
    for (const auto& [a, b] : pairs)
      bad.push_back(face(a) + " meets " + face(b));
    if (pairs.size() <= parted_pairs)
      if (const std::optional<Smoothing> smoothing = smooth_apart(mesh_, parted_movement * diagonal_)) {
        result_.mended.push_back(fmt::format(
            "moved {} vertices by up to {:.2g} mm to part {} pairs of triangles that passed through each other: {}",
            smoothing->vertices, 1e3 * smoothing->movement, pairs.size(), listed(bad)));
        return;
      }
    refuse(fmt::format("the surface passes through itself at {} pairs of triangles: {}", bad.size(), listed(bad)));
  }

  void warn_about_size() {
    constexpr double largest = 2, smallest = 0.005; // m
    const double extent = bounds(mesh_).extent().maxCoeff();
    if (extent > largest)
      result_.warnings.push_back(
          fmt::format("{}: the surface is {:.4g} m across; is it in millimetres? use scale = 0.001", name_, extent));
    else if (extent < smallest)
      result_.warnings.push_back(
          fmt::format("{}: the surface is {:.4g} m across, small for an organ; is the scale right?", name_, extent));
  }

  enum class Turn : std::uint8_t { unknown, keep, flip };

  const PolygonSoup& soup_;
  std::string name_;
  SurfaceChoices choices_;
  std::vector<Turn> turn_; // of each triangle to agree with the first of its component
  SurfaceMesh mesh_;
  std::vector<int> source_; // face of the soup that each triangle comes from
  double diagonal_ = 0;     // m, of the bounding box
  int oriented_ = 0;        // triangles of pieces that were given an orientation
  int turned_ = 0;          // of them, those whose orientation differs from the soup's
  int turned_in_ = 0;       // the same of cavities
  CheckedSurface result_;
};

} // namespace

CheckedSurface check_surface(const PolygonSoup& soup, const std::string& name, const SurfaceChoices& choices) {
  return Checker(soup, name, choices).run();
}

CheckedSurface check_sheet_surface(const PolygonSoup& soup, const std::string& name) {
  return Checker(soup, name).run_sheet();
}

CheckedSurface read_surface(const std::filesystem::path& file, double scale_to_metres, const SurfaceChoices& choices) {
  const PolygonSoup soup = read_polygons(file, scale_to_metres);
  CheckedSurface checked = check_surface(soup, file.string(), choices);
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".stl")
    checked.mended.insert(checked.mended.begin(),
                          fmt::format("joined the {} corners of STL facets into {} shared vertices",
                                      3 * soup.polygons.size(), soup.vertices.size()));
  return checked;
}

} // namespace spherecut::topology
