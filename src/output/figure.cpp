#include "src/output/figure.hpp"

#include "topology/base/errors.hpp"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <fstream>
#include <memory>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ; // NOLINT(readability-redundant-declaration): POSIX leaves it to the program

namespace spherecut::app {

namespace {

// Okabe and Ito's palette, told apart with any colour vision; paired with shapes and dashes for print in grey.
constexpr std::array colours{"#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"};
constexpr std::array shapes{7, 5, 9, 11, 13, 6, 4};

/// A gnuplot string in double quotes with every ASCII character as an octal code (digits too: gnuplot would read them
/// as part of the code before). So nothing in a label can end the string or run a command.
std::string gnuplot_quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x80)
      result += c;
    else
      result += fmt::format("\\{:03o}", byte < 0x20 || byte == 0x7f ? ' ' : byte);
  }
  return result + '"';
}

/// Points of a series, one a line; a blank line where points were left out, so that no line is drawn across the gap.
std::string point_lines(const Figure& figure, const Series& series) {
  std::string result;
  bool gap = false;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const double x = series.x[i], y = series.y[i];
    if (!std::isfinite(x) || !std::isfinite(y) || (figure.log_x && x <= 0) || (figure.log_y && y <= 0)) {
      gap = !result.empty();
      continue;
    }
    result += fmt::format("{}{:.12g} {:.12g}\n", gap ? "\n" : "", x, y);
    gap = false;
  }
  return result;
}

std::string style(const Series& series, int k) {
  const std::string colour = fmt::format("lc rgb '{}'", colours[static_cast<std::size_t>(k) % colours.size()]);
  const std::string line = fmt::format("lw 2 dt {}", 1 + k / static_cast<int>(colours.size()));
  const std::string point = fmt::format("pt {} ps 1.1", shapes[static_cast<std::size_t>(k) % shapes.size()]);
  switch (series.style) {
  case SeriesStyle::lines:
    return fmt::format("with lines {} {}", line, colour);
  case SeriesStyle::points:
    return fmt::format("with points {} {}", point, colour);
  case SeriesStyle::lines_and_points:
    break;
  }
  return fmt::format("with linespoints {} {} {}", line, point, colour);
}

std::string script(const Figure& figure, const std::filesystem::path& file) {
  std::string data, plot;
  int drawn = 0;
  for (const Series& series : figure.series) {
    if (series.x.size() != series.y.size())
      throw InputError(fmt::format("figure {}: series '{}' has {} x values and {} y values (must be equal)",
                                   file.string(), series.label, series.x.size(), series.y.size()));
    const std::string lines = point_lines(figure, series);
    if (lines.empty())
      continue;
    data += fmt::format("$data{} << END_OF_DATA\n{}END_OF_DATA\n", drawn, lines);
    plot += fmt::format("{}$data{} using 1:2 {} title {}", drawn > 0 ? ", " : "plot ", drawn, style(series, drawn),
                        gnuplot_quoted(series.label));
    ++drawn;
  }
  if (drawn == 0)
    throw InputError(fmt::format("figure {}: none of its {} series has a point that can be drawn", file.string(),
                                 figure.series.size()));
  std::string text = fmt::format("set encoding utf8\n"
                                 "if (strstrt(GPVAL_TERMINALS, 'pngcairo') > 0) {{\n"
                                 "  set terminal pngcairo size {0},{1} font 'Sans,12' noenhanced\n"
                                 "}} else {{\n"
                                 "  set terminal png size {0},{1} noenhanced\n"
                                 "}}\n",
                                 figure.width, figure.height);
  text += fmt::format("set title {}\nset xlabel {}\nset ylabel {}\n", gnuplot_quoted(figure.title),
                      gnuplot_quoted(figure.x_label), gnuplot_quoted(figure.y_label));
  text += "set border 3 lw 1.2\nset tics nomirror out\n"
          "set grid back lt 1 lw 0.8 lc rgb '#d9d9d9'\n"
          "set key outside below center horizontal Left reverse samplen 2.5 height 0.8\n";
  if (figure.log_x)
    text += "set logscale x\n";
  if (figure.log_y)
    text += "set logscale y\n";
  return text + data + plot + '\n';
}

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

/// Runs gnuplot with the script on its standard input and `output` on its standard output; no shell, no pipe. Returns
/// what it said on standard error, empty when it succeeded.
std::string run_gnuplot(const std::string& text, int output) {
  const File input(std::tmpfile()), errors(std::tmpfile());
  if (!input || !errors)
    throw InputError(fmt::format("gnuplot: no temporary file: {}", std::strerror(errno)));
  if (std::fwrite(text.data(), 1, text.size(), input.get()) != text.size() || std::fflush(input.get()) != 0)
    throw InputError(fmt::format("gnuplot: temporary file cannot be written: {}", std::strerror(errno)));
  std::rewind(input.get());

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, fileno(input.get()), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(errors.get()), STDERR_FILENO);
  std::string program = "gnuplot", no_init_files = "--default-settings";
  std::array<char*, 3> arguments{program.data(), no_init_files.data(), nullptr};
  pid_t child = 0;
  const int failure = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failure != 0)
    throw InputError(
        fmt::format("gnuplot cannot be started: {} (install the package gnuplot-nox)", std::strerror(failure)));
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR)
      throw InputError(fmt::format("gnuplot: lost track of it: {}", std::strerror(errno)));
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
    return {};
  std::string said(2000, '\0');
  std::rewind(errors.get());
  said.resize(std::fread(said.data(), 1, said.size(), errors.get()));
  while (!said.empty() && said.back() == '\n')
    said.pop_back();
  return fmt::format("gnuplot ended with status {}: {}", status, said);
}

/// Begins with the PNG signature and ends with the IEND chunk: written in full.
bool whole_png(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string head(8, '\0'), tail(8, '\0');
  in.read(head.data(), 8);
  in.seekg(-8, std::ios::end);
  in.read(tail.data(), 8);
  return in.good() && head == "\x89PNG\r\n\x1a\n" && tail == "IEND\xae\x42\x60\x82";
}

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos)
    return text;
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"')
      result += '"';
    result += c;
  }
  return result + '"';
}

std::string csv_line(const std::vector<std::string>& cells) {
  std::string line;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i > 0)
      line += ',';
    line += csv_cell(cells[i]);
  }
  return line + '\n';
}

} // namespace

void write_png(const Figure& figure, const std::filesystem::path& file) {
  if (figure.width < 100 || figure.height < 100 || figure.width > 10000 || figure.height > 10000)
    throw InputError(fmt::format("figure {}: size {} x {} pixels (allowed: 100 to 10000 each)", file.string(),
                                 figure.width, figure.height));
  const std::string text = script(figure, file);
  const int output = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (output < 0)
    throw InputError(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(errno)));
  std::string problem;
  try {
    problem = run_gnuplot(text, output);
  } catch (const InputError& error) {
    problem = error.what();
  }
  if (::close(output) != 0 && problem.empty())
    problem = std::strerror(errno);
  if (problem.empty() && !whole_png(file))
    problem = "gnuplot left an incomplete picture (is the disk full?)";
  if (problem.empty())
    return;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(file, ignored))
    std::filesystem::remove(file, ignored);
  throw InputError(fmt::format("{}: figure not written: {}", file.string(), problem));
}

Table::Table(std::vector<std::string> columns) : columns_(std::move(columns)) {
  if (columns_.empty())
    throw InputError("table: it has no column (at least one is needed)");
}

void Table::add(const std::vector<double>& row) {
  std::vector<std::string> cells;
  cells.reserve(row.size());
  for (const double value : row)
    cells.push_back(std::isnan(value) ? std::string() : fmt::format("{:.9g}", value));
  add(cells);
}

void Table::add(const std::vector<std::string>& row) {
  if (row.size() != columns_.size())
    throw InputError(fmt::format("table with first column '{}': row {} has {} cells (must be {})", columns_.front(),
                                 rows_.size() + 1, row.size(), columns_.size()));
  rows_.push_back(row);
}

void Table::write(const std::filesystem::path& file) const {
  std::ofstream out(file, std::ios::binary);
  if (!out)
    throw InputError(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(errno)));
  out << csv_line(columns_);
  for (const std::vector<std::string>& row : rows_)
    out << csv_line(row);
  out.close();
  if (!out)
    throw InputError(fmt::format("{}: table not written in full (is the disk full?)", file.string()));
}

} // namespace spherecut::app
