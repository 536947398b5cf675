// What a run leaves behind: forces.csv, cuts.csv and tears.csv row by row, VTP frames in a PVD series, figures,
// summary.json.
#pragma once

#include "src/base/output_file.hpp"
#include "src/output/cut_output.hpp"
#include "src/output/vtp.hpp"
#include "src/session/session.hpp"
#include "topology/domain/level_set.hpp"

#include <map>

namespace spherecut::app {

enum class RunStatus { complete, interrupted, failed };

/// What the run found, for the summary and the last lines on the screen.
struct RunFindings {
  std::size_t steps = 0;   // done
  std::size_t planned = 0; // of the motion
  bool touched = false;    // a force was felt
  StepResult peak;         // step of the largest force
  /// The largest torque about a reference point.
  struct PeakTorque {
    Vector3 torque = Vector3::Zero(); // N m
    double time = 0;                  // s
    void take(const Vector3& candidate, double at) {
      if (candidate.norm() > torque.norm()) {
        torque = candidate;
        time = at;
      }
    }
  };
  PeakTorque peak_torque, peak_blade_torque; // of the tool, and of a blade that the tissue resists
  double largest_residual = 0, largest_rotation_degrees = 0;
  std::vector<int> iterations;                        // of the steps of a body at finite strain that took any
  double least_jacobian = 1;                          // of these
  std::vector<std::pair<double, double>> resprinkles; // time, relative jump of the force
  CutReport cut;                                      // of the last step
  double largest_opening = 0;                         // m
  double largest_penetration = 0;                     // m, of the surface in the tool
  double self_penetration = 0;                        // m, of the surface through itself
  int increments = 0, refused_cuts = 0;
  TearReport tear;                          // of the last step, its account of the whole run
  int tear_increments = 0;                  // of the whole run, as the next four
  std::map<SystemUpdate, int> tear_updates; // how the system followed them
  bool torn_unstably = false, severed_by_tear = false;
  int seeds = 0;
  /// Second opinions on the pieces: whenever their number has changed, and at the end.
  struct PieceCheck {
    double time = 0;                   // s
    int pieces = 0;                    // of the wound
    std::vector<double> voxel_volumes; // m3, of the pieces by flooding voxels, largest first
    double voxel_size = 0;             // m
    double hausdorff = 0;              // m, between wound and voxels; infinite when the numbers differ
    bool components_agree = true;      // with CGAL's count, Euler characteristics and volumes
  };
  std::vector<PieceCheck> piece_checks;
};

/// The columns of forces.csv; those of a law that is not linear have one more.
std::span<const Column<StepResult>> force_columns(bool is_nonlinear);

/// Middle of the values, the upper one of two; 0 of none.
int median(std::vector<int> values);

class RunOutput {
 public:
  /// Opens forces.csv, cuts.csv when the scenario cuts, and tears.csv when it tears, in a folder of
  /// claim_results_folder(). Throws OutputError when a file cannot be written; so do the others.
  RunOutput(std::filesystem::path folder, const Session& session);

  /// Removes the files of a run that has done no step. Nothing is to be added afterwards.
  void withdraw();

  /// Adds the row, and the frame when one is due, of the step that the session has just done.
  void add(const Session& session, const StepResult& step);

  /// Counts the pieces of the cut body once more, by CGAL and by flooding voxels of the organ's level set. A count that
  /// differs from that of the wound is a remark.
  void check_pieces(const Session& session, double time);

  /// Draws the figures. What stops gnuplot is a remark in the summary, the numbers are safe by then.
  void draw_figures(const Session& session);

  void write_summary(const Session& session, RunStatus status, const std::string& message);

  /// What is on the disk by now, in words: files, and how many steps and frames they hold.
  [[nodiscard]] std::string kept() const;

  [[nodiscard]] const RunFindings& findings() const { return findings_; }
  [[nodiscard]] const std::vector<std::string>& files() const { return files_; }
  [[nodiscard]] const std::vector<std::string>& remarks() const { return remarks_; }

 private:
  [[nodiscard]] bool pieces_checked(double time) const;
  void add_row(OutputFile& file, const std::string& name, const std::string& row);
  void add_frame(const Session& session, const StepResult& step);
  void write_frame(const Session& session, const StepResult& step);
  void draw(const Figure& figure, const std::string& name);
  void keep_profile(const Session& session, const StepResult& step);

  std::filesystem::path folder_;
  std::optional<OutputFile> forces_, cuts_, tears_; // with a tool, with a cut, with tearing
  RunFindings findings_;
  std::unique_ptr<topology::LevelSet> level_set_; // of the organ, from the first check of pieces on
  std::vector<SeriesEntry> series_;
  std::size_t frames_ = 0;                  // in the series
  std::map<std::string, std::size_t> rows_; // steps in each table
  std::vector<StepResult> history_;
  Figure profile_;
  std::vector<std::string> files_;
  std::vector<std::string> remarks_;
};

} // namespace spherecut::app
