// How a cut is written: rows of cuts.csv, frames of wound and incision, figures.
#pragma once

#include "src/output/columns.hpp"
#include "src/output/figure.hpp"
#include "src/session/session.hpp"

namespace spherecut::app {

/// What a row of cuts.csv tells of: a step at `time`, s.
struct CutRow {
  double time;
  const CutReport& report;
};
std::span<const Column<CutRow>> cut_columns();

/// "0123456789abcdef"
std::string hash_text(std::uint64_t hash);

/// The wound deformed as each side of the cut moves, with displacement and von Mises stress at its points and, on its
/// triangles, part (0 organ, 1 wall on the + side of its sheet, 2 on the - side), piece and sheet. Throws InputError
/// when the file cannot be written; so does the other.
void write_wound(const std::filesystem::path& file, const Session& session);

/// The sheets at rest and the front as lines, each with its sheet.
void write_incision(const std::filesystem::path& file, const topology::Incision& incision);

/// Opening, area and pieces over time; `times` and `reports` one per step.
std::vector<std::pair<std::string, Figure>> cut_figures(const std::vector<double>& times,
                                                        const std::vector<CutReport>& reports);

/// Von Mises stress, Pa.
double von_mises(const Matrix3& stress);

} // namespace spherecut::app
