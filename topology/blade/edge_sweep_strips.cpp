// The triangles of what a run of pieces sweeps, and the sheet that they go to.
#include "topology/blade/edge_sweep.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

namespace spherecut::topology {

namespace {

void flip(Strip& strip) {
  for (Triangle& t : strip.triangles)
    std::swap(t[1], t[2]);
  for (std::array<Vector3, 3>& corners : strip.corners)
    std::swap(corners[1], corners[2]);
}

/// How good two triangles are that share an edge: those that do not fold there before those that do, then by the
/// flatter one.
std::pair<bool, double> goodness(const std::array<Vector3, 3>& p, const std::array<Vector3, 3>& q) {
  const Vector3 n = (p[1] - p[0]).cross(p[2] - p[0]), m = (q[1] - q[0]).cross(q[2] - q[0]);
  return {n.dot(m) > 0, std::min(quality(p[0], p[1], p[2]), quality(q[0], q[1], q[2]))};
}

std::pair<bool, double> rising(const std::vector<Vector3>& a, const std::vector<Vector3>& b, std::size_t i) {
  return goodness({a[i], a[i + 1], b[i + 1]}, {a[i], b[i + 1], b[i]});
}

std::pair<bool, double> falling(const std::vector<Vector3>& a, const std::vector<Vector3>& b, std::size_t i) {
  return goodness({a[i], a[i + 1], b[i]}, {a[i + 1], b[i + 1], b[i]});
}

/// The better of the two diagonals of a piece's quadrangle, from the left of the old edge when they are as good.
bool rises(const std::vector<Vector3>& a, const std::vector<Vector3>& b, std::size_t i) {
  const auto [is_flat, up] = rising(a, b, i);
  const auto [is_flat_down, down] = falling(a, b, i);
  return is_flat != is_flat_down ? is_flat : up > down * (1 - 1e-6);
}

} // namespace

bool EdgeSweep::sound(const Motion& motion, std::size_t i) {
  const std::vector<Vector3>&a = motion.a, &b = motion.b;
  if (a[i] == b[i])
    return quality(a[i], a[i + 1], b[i + 1]) > flattest_of_strip;
  if (a[i + 1] == b[i + 1])
    return quality(a[i], a[i + 1], b[i]) > flattest_of_strip;
  return (rises(a, b, i) ? rising(a, b, i) : falling(a, b, i)).second > flattest_of_strip;
}

bool EdgeSweep::crosses(int sheet, const Strip& strip) const {
  for (std::size_t t = 0; sheet >= 0 && t < strip.triangles.size(); ++t)
    if (sheets_.crosses(sheet, strip.triangles[t], strip.corners[t]))
      return true;
  return false;
}

// Piece by piece, for a run without anchors.
Strip EdgeSweep::strip(const Run& run, const Motion& motion) const {
  const std::vector<Vector3>&a = motion.a, &b = motion.b;
  Strip result;
  const int base = run.sheet < 0 ? 0 : static_cast<int>(sheets_.sheets()[run.sheet].vertices.size());
  const auto vertex = [&](const Vector3& x) {
    result.vertices.push_back(x);
    return base + static_cast<int>(result.vertices.size()) - 1;
  };
  const auto known = [&](std::size_t i) { return run.sheet >= 0 && leads_[i].sheet == run.sheet; };
  const auto add = [&](const Triangle& t, const Vector3& p, const Vector3& q, const Vector3& r) {
    result.triangles.push_back(t);
    result.corners.push_back({p, q, r});
  };
  int a_right = -1, b_right = -1;
  for (std::size_t i = run.first; i < run.last; ++i) {
    const bool left_stays = a[i] == b[i], right_stays = a[i + 1] == b[i + 1];
    const int a_left = known(i) ? leads_[i].left : i > run.first ? a_right : vertex(a[i]);
    const int b_left = i > run.first ? b_right : left_stays ? a_left : vertex(b[i]);
    a_right = known(i) ? leads_[i].right : i + 1 < run.last && known(i + 1) ? leads_[i + 1].left : vertex(a[i + 1]);
    b_right = right_stays ? a_right : vertex(b[i + 1]);
    if (left_stays)
      add({a_left, a_right, b_right}, a[i], a[i + 1], b[i + 1]);
    else if (right_stays)
      add({a_left, a_right, b_left}, a[i], a[i + 1], b[i]);
    else if (rises(a, b, i)) {
      add({a_left, a_right, b_right}, a[i], a[i + 1], b[i + 1]);
      add({a_left, b_right, b_left}, a[i], b[i + 1], b[i]);
    } else {
      add({a_left, a_right, b_left}, a[i], a[i + 1], b[i]);
      add({a_right, b_right, b_left}, a[i + 1], b[i + 1], b[i]);
    }
    result.leads.push_back({b_left, b_right});
  }
  if (run.flipped)
    flip(result);
  return result;
}

// Appends the vertices between two anchors on the way along the borders from one to the other, those of `sheet` as its
// own.
void EdgeSweep::add_between(const Anchor& p, const Anchor& q, int sheet, std::vector<StripPoint>& points) const {
  constexpr double longest = 4; // edges
  if (!p.is_set() || !q.is_set())
    return;
  const std::vector<SheetVertex> way =
      way_along_borders(sheets_, {p.sheet, p.vertex}, {q.sheet, q.vertex}, longest * options_.edge);
  for (std::size_t k = 1; k + 1 < way.size(); ++k)
    points.push_back(
        {sheets_.sheets()[way[k].sheet].vertices[way[k].vertex], way[k].sheet == sheet ? way[k].vertex : -1});
}

// What lies between the rows of a run and the borders between its anchors.
std::optional<Strip> EdgeSweep::abutting_strip(const Run& run, const Motion& motion) const {
  const auto& [a, b, from, to, strokes] = motion;
  const auto [first, last, sheet, flipped] = run;
  const auto vertex = [sheet = sheet](const Anchor& at) { return sheet >= 0 && at.sheet == sheet ? at.vertex : -1; };
  const auto known = [&, first = first, last = last, sheet = sheet](std::size_t i) {
    int own = sheet >= 0 && i > first && leads_[i - 1].sheet == sheet ? leads_[i - 1].right : -1;
    if (sheet >= 0 && i < last && leads_[i].sheet == sheet)
      own = leads_[i].left;
    return own >= 0 && vertex_of({sheet, own}) == motion.a[i] ? own : -1; // it may have gone to a border
  };
  std::vector<StripPoint> lower, upper;
  if (to[first].is_set() && from[first].is_set() && b[first] != a[first]) {
    lower.push_back({b[first], vertex(to[first])});
    add_between(to[first], from[first], sheet, lower);
  }
  for (std::size_t i = first; i <= last; ++i) {
    if (i > first && known(i) < 0)
      add_between(from[i - 1], from[i], sheet, lower);
    lower.push_back({a[i], known(i) >= 0 ? known(i) : vertex(from[i])});
    if (i > first)
      add_between(to[i - 1], to[i], sheet, upper);
    upper.push_back({b[i], vertex(to[i])});
  }
  if (to[last].is_set() && from[last].is_set() && b[last] != a[last]) {
    add_between(from[last], to[last], sheet, lower);
    lower.push_back({b[last], vertex(to[last])});
  }
  const int base = sheet < 0 ? 0 : static_cast<int>(sheets_.sheets()[sheet].vertices.size());
  std::optional<Strip> result = strip_between(lower, upper, base);
  if (!result || result->triangles.empty())
    return result;
  // Leads of the pieces: none where the border of an earlier sheet lies between their points.
  std::vector<std::array<int, 2>> of_pieces;
  std::size_t at = 0;
  for (std::size_t i = first; i < last; ++i) {
    std::vector<StripPoint> inserted;
    add_between(to[i], to[i + 1], sheet, inserted);
    const bool is_old = to[i].is_set() && to[i].sheet == to[i + 1].sheet;
    const bool is_one = inserted.empty() && b[i] != b[i + 1] && !is_old;
    of_pieces.push_back(is_one ? result->leads[at] : std::array<int, 2>{-1, -1});
    at += inserted.size() + 1;
  }
  result->leads = std::move(of_pieces);
  if (flipped)
    flip(*result);
  return result;
}

// The sheet from whose border alone a run goes on, without a sharp turn; -1: none.
int EdgeSweep::left_sheet(const Run& run, const Motion& motion) const {
  int sheet = -1;
  for (std::size_t i = run.first; i <= run.last; ++i) {
    const Anchor& from = motion.from[i];
    if (!from.is_set())
      continue;
    const Stroke& stroke = motion.strokes[std::min(i, run.last - 1)];
    if ((sheet >= 0 && from.sheet != sheet) || std::abs(stroke.normal.dot(from.normal)) < cos_turn_)
      return -1;
    sheet = from.sheet;
  }
  return sheet;
}

void EdgeSweep::append(Run run, const Strip& added, const Motion& motion) {
  if (run.sheet < 0)
    run.sheet = sheets_.add_sheet();
  for (const Vector3& x : added.vertices)
    sheets_.add_vertex(run.sheet, x);
  for (const Triangle& t : added.triangles)
    sheets_.add_triangle(run.sheet, t);
  for (std::size_t i = run.first; i < run.last; ++i) {
    const auto [left, right] = added.leads[i - run.first];
    leads_[i] = left < 0 ? Lead{} : Lead{run.sheet, left, right, motion.strokes[i].normal, run.flipped};
  }
}

// Piece by piece, to the run's sheet or, where that is none or would be crossed, to a new one.
void EdgeSweep::append_plain(Run run, const Motion& motion, bool is_checked) {
  Strip added = strip(run, motion);
  if (crosses(run.sheet, added) ||
      (is_checked && run.sheet >= 0 && !sheets_.stays_sheet(run.sheet, added.triangles, added.corners))) {
    run.sheet = -1;
    run.flipped = false;
    added = strip(run, motion);
  }
  append(run, added, motion);
}

// A run some of whose points lie on borders of earlier sheets: to the sheet that it extends, or to one that it comes
// out of, else to a new one.
EdgeSweep::Abutting EdgeSweep::append_abutting(const Run& run, const Motion& motion) {
  std::vector<Run> choices{run};
  if (const int left = run.sheet < 0 ? left_sheet(run, motion) : -1; left >= 0)
    choices = {{run.first, run.last, left, false}, {run.first, run.last, left, true}};
  choices.push_back({run.first, run.last, -1, false});
  for (const Run& choice : choices) {
    const std::optional<Strip> added = abutting_strip(choice, motion);
    if (added && added->triangles.empty())
      return Abutting::nothing;
    const bool stays =
        added && (choice.sheet < 0 || sheets_.stays_sheet(choice.sheet, added->triangles, added->corners));
    if (stays && !crosses(choice.sheet, *added)) {
      append(choice, *added, motion);
      drop_used_leads(choice.sheet);
      return Abutting::added;
    }
  }
  return Abutting::failed;
}

// Pieces whose edge a strip has closed lead no further.
void EdgeSweep::drop_used_leads(int sheet) {
  if (sheet < 0)
    return;
  for (Lead& lead : leads_) {
    if (lead.sheet != sheet)
      continue;
    const std::vector<int>&left = sheets_.around(sheet, lead.left), &right = sheets_.around(sheet, lead.right);
    if (std::count_if(left.begin(), left.end(),
                      [&](int t) { return std::find(right.begin(), right.end(), t) != right.end(); }) != 1)
      lead = {};
  }
}

} // namespace spherecut::topology
