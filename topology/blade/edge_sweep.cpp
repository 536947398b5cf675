#include "topology/blade/edge_sweep.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::topology {

namespace {

Vector3 nearest_on(const std::vector<Vector3>& polyline, const Vector3& x) {
  Vector3 nearest = polyline.front();
  for (std::size_t i = 1; i < polyline.size(); ++i) {
    const Vector3 along = polyline[i] - polyline[i - 1];
    const double s = std::clamp((x - polyline[i - 1]).dot(along) / along.squaredNorm(), 0.0, 1.0);
    const Vector3 candidate = polyline[i - 1] + s * along;
    if ((candidate - x).norm() < (nearest - x).norm())
      nearest = candidate;
  }
  return nearest;
}

} // namespace

EdgeSweep::EdgeSweep(std::shared_ptr<const Domain> domain, const SweepOptions& options)
    : domain_(std::move(domain)), options_(options), sheets_(2 * options.edge, least_reach * options.edge),
      tiny_(1e-4 * options.edge), cos_turn_(std::cos(options.sharp_turn * M_PI / 180)) {}

void EdgeSweep::place(std::vector<Vector3> row) {
  row_ = std::move(row);
  leads_.assign(row_.empty() ? 0 : row_.size() - 1, {});
  anchors_.assign(row_.size(), {});
}

int EdgeSweep::add(const SurfaceMesh& sheet) {
  const int number = sheets_.add_sheet();
  for (const Vector3& x : sheet.vertices)
    sheets_.add_vertex(number, x);
  for (const Triangle& triangle : sheet.triangles)
    sheets_.add_triangle(number, triangle);
  return number;
}

void EdgeSweep::extend(int sheet, const SurfaceMesh& grown) {
  const SurfaceMesh& now = sheets_.sheets()[static_cast<std::size_t>(sheet)];
  const std::size_t vertices = now.vertices.size(), triangles = now.triangles.size();
  for (std::size_t v = vertices; v < grown.vertices.size(); ++v)
    sheets_.add_vertex(sheet, grown.vertices[v]);
  for (std::size_t t = triangles; t < grown.triangles.size(); ++t)
    sheets_.add_triangle(sheet, grown.triangles[t]);
  leads_.assign(leads_.size(), {});
  anchors_.assign(anchors_.size(), {});
}

// Whether a piece goes on in the sheet that it leads.
bool EdgeSweep::extends(const Motion& motion, std::size_t i) const {
  return i < leads_.size() && leads_[i].sheet >= 0 && !motion.strokes[i].turns;
}

void EdgeSweep::measure(Motion& motion) const {
  const auto& [a, b, from, to, strokes] = motion;
  for (std::size_t i = 0; i < strokes.size(); ++i) {
    const Vector3 area_vector = 0.5 * (b[i + 1] - a[i]).cross(b[i] - a[i + 1]);
    const double length = 0.5 * ((a[i + 1] - a[i]).norm() + (b[i + 1] - b[i]).norm());
    Stroke& stroke = motion.strokes[i];
    stroke.swept = area_vector.norm() > tiny_ * length;
    stroke.normal = stroke.swept ? Vector3(area_vector.normalized()) : Vector3::Zero();
    stroke.turns = leads_[i].sheet >= 0 && stroke.normal.dot(leads_[i].normal) < cos_turn_;
  }
}

// The wanted pieces from `first` on that make one strip.
EdgeSweep::Run EdgeSweep::run_from(std::size_t first, const Motion& motion) const {
  const auto& strokes = motion.strokes;
  const auto turns = [&](std::size_t i) { return leads_[i].sheet >= 0 && strokes[i].turns; };
  const auto joined = [&](std::size_t i) { // piece i + 1 may go on in the strip of piece i
    return motion.a[i + 1] != motion.b[i + 1] && strokes[i].normal.dot(strokes[i + 1].normal) > cos_turn_;
  };
  Run run{first, first + 1};
  if (extends(motion, first)) {
    run.sheet = leads_[first].sheet;
    run.flipped = leads_[first].flipped;
  }
  bool is_new = turns(first);
  for (; run.last < strokes.size() && strokes[run.last].wanted && joined(run.last - 1); ++run.last) {
    const Lead& lead = leads_[run.last];
    if (extends(motion, run.last)) {
      const bool other_sheet = run.sheet >= 0 && (run.sheet != lead.sheet || run.flipped != lead.flipped);
      const bool other_vertex = extends(motion, run.last - 1) && leads_[run.last - 1].right != lead.left;
      if (is_new || other_sheet || other_vertex)
        break;
      run.sheet = lead.sheet;
      run.flipped = lead.flipped;
    } else if (turns(run.last)) {
      if (run.sheet >= 0)
        break;
      is_new = true;
    }
  }
  return run;
}

void EdgeSweep::add_run(const Run& run, Motion& motion) {
  bool is_anchored = false;
  for (std::size_t i = run.first; i < run.last; ++i)
    is_anchored = is_anchored || motion.is_anchored(i);
  const Abutting abutting = is_anchored ? append_abutting(run, motion) : Abutting::added;
  if (!is_anchored)
    append_plain(run, motion, false);
  bool any = abutting == Abutting::added;
  for (std::size_t i = run.first; i < run.last; ++i) {
    Stroke& stroke = motion.strokes[i];
    stroke.added = abutting == Abutting::added;
    if (abutting != Abutting::failed || !sound(motion, i))
      continue;
    const bool goes_on = run.sheet >= 0 && leads_[i].sheet == run.sheet;
    append_plain({i, i + 1, goes_on ? run.sheet : -1, goes_on && run.flipped}, motion, true);
    stroke.added = any = true;
  }
  // Nothing lies between yet: the edge stays, and what it sweeps comes with the next motion.
  for (std::size_t i = run.first; i <= run.last && !any; ++i) {
    const bool is_shared = (i == run.first && i > 0 && motion.strokes[i - 1].added) ||
                           (i == run.last && i < motion.strokes.size() && motion.strokes[i].wanted);
    if (is_shared || (motion.b[i] - motion.a[i]).norm() > options_.edge)
      continue;
    motion.b[i] = motion.a[i];
    motion.to[i] = motion.from[i];
  }
}

void EdgeSweep::advance(std::vector<Vector3> next, Tally& tally) {
  Motion motion{row_, std::move(next), anchors_, std::vector<Anchor>(row_.size()), std::vector<Stroke>(leads_.size())};
  auto& [a, b, from, to, strokes] = motion;
  for (std::size_t i = 0; i < a.size(); ++i)
    if ((b[i] - a[i]).norm() <= tiny_)
      b[i] = a[i];
  measure(motion);
  for (const Stroke& stroke : strokes)
    tally.swept = tally.swept || stroke.swept;
  run_along_sheets(motion);
  for (std::size_t i = 0; i < a.size(); ++i)
    if ((b[i] - a[i]).norm() <= tiny_)
      a[i] = b[i] = (a[i] == row_[i] || from[i].is_set() ? a[i] : b[i]);
  measure(motion);

  std::vector<double> depth_a, depth_b;
  for (std::size_t i = 0; i < a.size(); ++i) {
    depth_a.push_back(domain_->signed_distance(a[i]));
    depth_b.push_back(domain_->signed_distance(b[i]));
  }
  for (std::size_t i = 0; i < strokes.size(); ++i) {
    const bool near_body = std::min({depth_a[i], depth_a[i + 1], depth_b[i], depth_b[i + 1]}) < options_.edge;
    tally.near_body = tally.near_body || near_body;
    strokes[i].wanted = strokes[i].swept && near_body && !cut_before(motion, i);
  }
  stop_at_borders(motion);
  for (std::size_t i = 0; i < strokes.size(); ++i)
    strokes[i].wanted = strokes[i].wanted && (motion.is_anchored(i) || sound(motion, i));
  for (std::size_t i = 0; i < strokes.size();) {
    if (!strokes[i].wanted) {
      ++i;
      continue;
    }
    const Run run = run_from(i, motion);
    add_run(run, motion);
    i = run.last;
  }
  for (std::size_t i = 0; i < strokes.size(); ++i)
    if (!strokes[i].added && (b[i] != row_[i] || b[i + 1] != row_[i + 1]))
      leads_[i] = {};
  for (std::size_t i = 0; i < b.size(); ++i)
    anchors_[i] = to[i].is_set() ? to[i] : b[i] == row_[i] ? from[i] : Anchor{};
  // Points that slid along the old edge stay on it, so that what they cut next leaves no film of tissue.
  for (std::size_t i = 0; i < b.size(); ++i) {
    const bool sweeps = (i > 0 && strokes[i - 1].swept) || (i < strokes.size() && strokes[i].swept);
    if (const Vector3 on_row = nearest_on(row_, b[i]);
        !sweeps && !anchors_[i].is_set() && (on_row - b[i]).norm() <= 2 * tiny_)
      b[i] = on_row;
  }
  row_ = std::move(b);
}

} // namespace spherecut::topology
