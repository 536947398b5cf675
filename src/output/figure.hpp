// Line figures as PNG, drawn by gnuplot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace spherecut::app {

enum class SeriesStyle { lines, points, lines_and_points };

struct Series {
  std::string label;
  std::vector<double> x, y; // same length; non-finite points are left out
  SeriesStyle style = SeriesStyle::lines_and_points;
};

struct Figure {
  std::string title, x_label, y_label; // labels carry their unit
  bool log_x = false, log_y = false;
  std::vector<Series> series;
  int width = 900, height = 600; // pixels
};

/// Draws the figure. Throws InputError when gnuplot is missing or the file cannot be written.
void write_png(const Figure& figure, const std::filesystem::path& file);

/// Comma separated table with a header line; numbers with 9 significant digits. Throws InputError when it cannot be
/// written in full.
class Table {
 public:
  explicit Table(std::vector<std::string> columns);
  void add(const std::vector<double>& row); // NaN is written as an empty cell
  void add(const std::vector<std::string>& row);
  void write(const std::filesystem::path& file) const;

 private:
  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> rows_;
};

} // namespace spherecut::app
