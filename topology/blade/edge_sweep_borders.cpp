// Where a moving edge meets what was swept before: points run along earlier sheets, leave them at their borders, and
// stop there.
#include "topology/blade/edge_sweep.hpp"

namespace spherecut::topology {

namespace {

constexpr int samples = 8; // of a point's way

} // namespace

Vector3 EdgeSweep::vertex_of(const Anchor& anchor) const {
  return sheets_.sheets()[anchor.sheet].vertices[anchor.vertex];
}

// The vertex of a sheet's border that a point of the edge at x, with its foot on that sheet, may be moved to.
EdgeSweep::Anchor EdgeSweep::anchor_at(const SweptSheets::Foot& foot, const Vector3& x) const {
  constexpr double farthest = 0.75; // edges
  const int vertex = nearest_on_border(sheets_, foot.sheet, x, 1.5 * sheets_.thickness(), farthest * options_.edge);
  return vertex < 0 ? Anchor{} : Anchor{foot.sheet, vertex, foot.normal};
}

// Where the way from x, which lies on a sheet, to y leaves all of them.
Vector3 EdgeSweep::last_on_sheets(const Vector3& x, const Vector3& y) const {
  double on = 0, off = 1;
  for (int halving = 0; halving < 20; ++halving)
    (sheets_.on_sheet(x + 0.5 * (on + off) * (y - x)) ? on : off) = 0.5 * (on + off);
  return x + on * (y - x);
}

// Whether sheets that were there before cover the way from x to y, both of which lie on one.
bool EdgeSweep::covered(const Vector3& x, const Vector3& y) const {
  for (int k = 1; k < samples; ++k)
    if (!sheets_.on_sheet(x + double(k) / samples * (y - x)))
      return false;
  return true;
}

// Whether the strip of a piece lies on sheets that were there before: its new edge, and the ways there.
bool EdgeSweep::cut_before(const Motion& motion, std::size_t i) const {
  const auto& [a, b, from, to, strokes] = motion;
  const Vector3 a_middle = 0.5 * (a[i] + a[i + 1]), b_middle = 0.5 * (b[i] + b[i + 1]);
  return sheets_.on_sheet(b[i]) && sheets_.on_sheet(b[i + 1]) && sheets_.on_sheet(b_middle) &&
         covered(a_middle, b_middle) && covered(a[i], b[i]) && covered(a[i + 1], b[i + 1]);
}

// Lets the points of the edge that no sheet hangs on run along the sheets they lie on, up to where they leave them: a
// vertex of the border there, where one is near (`from`). One that gets no farther than `least_reach` from there has
// cut nothing yet, and stays (`b`, `to`).
void EdgeSweep::run_along_sheets(Motion& motion) {
  auto& [a, b, from, to, strokes] = motion;
  const auto sweeps_on = [&](std::size_t i) { return extends(motion, i) && motion.strokes[i].swept; };
  std::vector<char> stays(a.size(), 0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i] == b[i] || sweeps_on(i) || (i > 0 && sweeps_on(i - 1)) || !sheets_.on_sheet(a[i]))
      continue;
    const Vector3 start = a[i], way = b[i] - a[i];
    const auto at = [&](int k) { return Vector3(start + double(k) / samples * way); };
    int k = 1;
    while (k <= samples && sheets_.on_sheet(at(k)))
      ++k;
    Vector3 left_at = b[i];
    Anchor left;
    if (k <= samples) {
      const Vector3 last = last_on_sheets(at(k - 1), at(k));
      const auto foot = sheets_.on_sheet(last);
      left_at = foot ? foot->point : a[i];
      const bool has_lead = (i > 0 && leads_[i - 1].sheet >= 0) || (i < leads_.size() && leads_[i].sheet >= 0);
      const bool slides = (left_at - a[i]).norm() > 3 * tiny_ && (last - a[i]).norm() > 2 * sheets_.thickness();
      if (!slides && (has_lead || from[i].is_set()))
        continue;
      if (foot)
        left = anchor_at(*foot, last);
      if (!slides && !left.is_set()) { // out of the middle of the sheet, from the sheet itself
        a[i] = left_at;
        continue;
      }
      stays[i] = left.is_set() && (b[i] - left_at).norm() < least_reach * options_.edge ? 1 : 0;
    }
    from[i] = left;
    a[i] = left.is_set() && stays[i] == 0 ? vertex_of(left) : left_at;
    if (stays[i] != 0)
      b[i] = left_at;
    if (i > 0)
      leads_[i - 1] = {};
    if (i < leads_.size())
      leads_[i] = {};
  }
  const auto leaves = [&](std::size_t i) { return i < motion.a.size() && stays[i] == 0 && motion.a[i] != motion.b[i]; };
  for (std::size_t i = 0; i < a.size(); ++i) { // the end of a strip beside it is a vertex
    if (stays[i] == 0)
      continue;
    if (leaves(i + 1) || leaves(i - 1)) { // i - 1 wraps where there is none
      a[i] = b[i] = vertex_of(from[i]);
      to[i] = from[i];
    } else {
      from[i] = {};
    }
  }
}

// Points of the new edge that have come to lie on earlier sheets go back to a vertex of their border, so that the strip
// ends there. A piece that reaches out of a sheet by less than `least_reach` and no farther than its neighbours has cut
// nothing: its end is put on the sheet.
void EdgeSweep::stop_at_borders(Motion& motion) {
  auto& [a, b, from, to, strokes] = motion;
  std::vector<std::optional<SweptSheets::Foot>> on(b.size());
  for (std::size_t i = 0; i < b.size(); ++i)
    if (motion.is_wanted_at(i))
      on[i] = sheets_.on_sheet(b[i]);
  const std::vector<Vector3> old_a = a, old_b = b;
  for (std::size_t i = 0; i < strokes.size(); ++i) {
    if (!strokes[i].wanted || on[i].has_value() == on[i + 1].has_value())
      continue;
    const std::size_t p = on[i] ? i : i + 1, q = on[i] ? i + 1 : i; // on the sheet, off it
    const bool goes_on = p < q ? q < strokes.size() && strokes[q].wanted : q > 0 && strokes[q - 1].wanted;
    const Vector3 place = last_on_sheets(old_b[p], old_b[q]);
    if (!goes_on && (old_b[q] - place).norm() < least_reach * options_.edge) {
      strokes[i].wanted = false;
      b[q] = place;
      continue;
    }
    if (to[p].is_set())
      continue;
    to[p] = anchor_at(*on[p], place);
    if (!to[p].is_set())
      continue;
    b[p] = vertex_of(to[p]);
    if (extends(motion, p) || extends(motion, p - 1) || from[p].is_set()) // p - 1 wraps where there is none
      continue;
    const auto foot = sheets_.on_sheet(old_a[p]), foot_off = sheets_.on_sheet(old_a[q]);
    if (!foot)
      continue;
    if (foot_off) {
      from[p] = to[p];
      if (!from[q].is_set())
        from[q] = anchor_at(*foot_off, old_a[q]);
      if (from[q].is_set() && vertex_of(from[q]) != old_a[q])
        from[q] = {};
    } else {
      from[p] = anchor_at(*foot, last_on_sheets(old_a[p], old_a[q]));
    }
    if (from[p].is_set())
      a[p] = vertex_of(from[p]);
  }
  for (std::size_t i = 0; i < b.size(); ++i) { // those that come to a sheet from ahead of it
    if (!motion.is_wanted_at(i) || !on[i] || to[i].is_set() || b[i] != old_b[i] || a[i] == b[i] || covered(a[i], b[i]))
      continue;
    to[i] = anchor_at(*on[i], last_on_sheets(b[i], a[i]));
    if (to[i].is_set())
      b[i] = vertex_of(to[i]);
  }
}

} // namespace spherecut::topology
