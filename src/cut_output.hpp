// How a cut is written: rows of cuts.csv, frames of wound and incision, figures.
#pragma once

#include "src/figure.hpp"
#include "src/session.hpp"

#include <string_view>

namespace spherecut::app {

/// First line of cuts.csv, with its end of line.
std::string_view cut_columns();
/// One row of it; `report` of a step at `time` s.
std::string cut_row(double time, const CutReport& report);

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
