// The sheets that a row of points sweeps from place to place at rest: strips between the rows, and how they abut on
// what was swept before. Used by the blade sweep alone.
//
// A motion goes from the points a of the row to b; piece i lies between points i and i + 1. Three things are done, each
// in its own source: points are moved to the borders of earlier sheets (edge_sweep_borders.cpp), pieces are gathered
// into runs (edge_sweep.cpp), and runs become strips of triangles (edge_sweep_strips.cpp).
#pragma once

#include "topology/blade/abutting_strip.hpp"
#include "topology/blade/blade.hpp"
#include "topology/blade/sheet_borders.hpp"
#include "topology/blade/swept_sheets.hpp"

namespace spherecut::topology {

class EdgeSweep {
 public:
  EdgeSweep(std::shared_ptr<const Domain> domain, const SweepOptions& options);

  [[nodiscard]] const SweptSheets& sheets() const { return sheets_; }
  /// Where the edge last cut or was placed; empty: it is lifted.
  [[nodiscard]] const std::vector<Vector3>& row() const { return row_; }

  /// The next motion starts from here.
  void place(std::vector<Vector3> row);

  struct Tally {
    bool swept = false, near_body = false;
  };
  /// Moves the row to `next`, of as many points, and adds what it sweeps.
  void advance(std::vector<Vector3> next, Tally& tally);

  /// A sheet that is there otherwise: number of it.
  int add(const SurfaceMesh& sheet);
  /// A sheet continued otherwise: `grown` has its vertices and triangles first. The next strip starts a sheet.
  void extend(int sheet, const SurfaceMesh& grown);

 private:
  /// Where one piece of the edge leads a sheet.
  struct Lead {
    int sheet = -1;                   // -1: none
    int left = -1, right = -1;        // vertices of the sheet
    Vector3 normal = Vector3::Zero(); // unit, of the last strip there
    bool flipped = false;             // the + side of the sheet is not that of edge direction x motion
  };
  /// What one piece of the edge does between two rows.
  struct Stroke {
    Vector3 normal = Vector3::Zero();
    bool swept = false; // has area
    bool turns = false; // sharply from the strip it would extend
    bool wanted = false;
    bool added = false;
  };
  /// Vertex of a sheet's border on which a point lies.
  struct Anchor {
    int sheet = -1, vertex = -1;      // -1: on none
    Vector3 normal = Vector3::Zero(); // unit, of the sheet there
    [[nodiscard]] bool is_set() const { return sheet >= 0; }
  };
  struct Motion {
    std::vector<Vector3> a, b;
    std::vector<Anchor> from, to; // of a, of b
    std::vector<Stroke> strokes;
    /// Whether a piece beside this point is to be cut.
    [[nodiscard]] bool is_wanted_at(std::size_t point) const {
      return (point > 0 && strokes[point - 1].wanted) || (point < strokes.size() && strokes[point].wanted);
    }
    /// Whether the strip of a piece has to follow borders, or has points in common.
    [[nodiscard]] bool is_anchored(std::size_t i) const {
      return from[i].is_set() || from[i + 1].is_set() || to[i].is_set() || to[i + 1].is_set() || a[i] == a[i + 1] ||
             b[i] == b[i + 1];
    }
  };
  /// Pieces [first, last), and the sheet that they extend; -1: none.
  struct Run {
    std::size_t first, last;
    int sheet = -1;
    bool flipped = false;
  };

  [[nodiscard]] bool extends(const Motion& motion, std::size_t i) const;
  void measure(Motion& motion) const;
  [[nodiscard]] Run run_from(std::size_t first, const Motion& motion) const;
  void add_run(const Run& run, Motion& motion);

  [[nodiscard]] Vector3 vertex_of(const Anchor& anchor) const;
  [[nodiscard]] Anchor anchor_at(const SweptSheets::Foot& foot, const Vector3& x) const;
  [[nodiscard]] Vector3 last_on_sheets(const Vector3& x, const Vector3& y) const;
  [[nodiscard]] bool covered(const Vector3& x, const Vector3& y) const;
  [[nodiscard]] bool cut_before(const Motion& motion, std::size_t i) const;
  void run_along_sheets(Motion& motion);
  void stop_at_borders(Motion& motion);

  [[nodiscard]] static bool sound(const Motion& motion, std::size_t i);
  [[nodiscard]] bool crosses(int sheet, const Strip& strip) const;
  [[nodiscard]] Strip strip(const Run& run, const Motion& motion) const;
  void add_between(const Anchor& p, const Anchor& q, int sheet, std::vector<StripPoint>& points) const;
  [[nodiscard]] std::optional<Strip> abutting_strip(const Run& run, const Motion& motion) const;
  [[nodiscard]] int left_sheet(const Run& run, const Motion& motion) const;
  void append(Run run, const Strip& added, const Motion& motion);
  void append_plain(Run run, const Motion& motion, bool is_checked);
  /// What came of a run: a strip; nothing, as nothing lies between the rows; no strip abuts.
  enum class Abutting : std::uint8_t { added, nothing, failed };
  Abutting append_abutting(const Run& run, const Motion& motion);
  void drop_used_leads(int sheet);

  static constexpr double least_reach = 0.25; // edges, out of an earlier sheet or beside it: less is not cut

  std::shared_ptr<const Domain> domain_;
  SweepOptions options_;
  SweptSheets sheets_;
  double tiny_; // m: less motion, less height than this is none
  double cos_turn_;
  std::vector<Vector3> row_;
  std::vector<Lead> leads_;     // of the pieces of the row
  std::vector<Anchor> anchors_; // of its points
};

} // namespace spherecut::topology
