// CSV files, the tables of the page in Markdown, and figures.
#include "experiments/remeshing_ledger/ledger.hpp"
#include "experiments/support/statistics.hpp"
#include "src/output/figure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fstream>

namespace spherecut::experiments::ledger {

namespace {

std::string number(double value, const char* format = "{:.6g}") {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : std::string();
}

std::string cell(double value, const char* format) {
  return std::isfinite(value) ? number(value, format) : std::string("-");
}

std::vector<std::string> distinct(const std::vector<Run>& runs, std::string Run::*field, const std::string& scenario) {
  std::vector<std::string> names;
  for (const Run& run : runs)
    if ((scenario.empty() || run.scenario == scenario) &&
        std::find(names.begin(), names.end(), run.*field) == names.end())
      names.push_back(run.*field);
  return names;
}

void write_csv(const std::vector<Run>& runs, const std::vector<Ratio>& ratios, const std::filesystem::path& out) {
  std::vector<std::string> columns{"scenario",  "back_end", "size", "repeat",
                                   "increment", "unknowns", "anew", "quality"};
  for (const auto& stage : stage_names)
    columns.push_back(std::string(stage) + "_ms");
  columns.insert(columns.end(), {"processor_ms", "wall_ms", "failure"});
  app::Table increments(columns);
  app::Table summary({"scenario", "back_end", "size", "repeat", "unknowns", "error", "volume", "marked", "force",
                      "force_error", "processor_ms", "median_processor_ms", "wall_ms", "condition", "quality",
                      "failures", "peak_memory_mb"});
  for (const Run& run : runs) {
    for (const Increment& i : run.increments) {
      std::vector<std::string> row{run.scenario,
                                   run.name,
                                   number(run.fine),
                                   fmt::format("{}", run.repeat),
                                   fmt::format("{}", i.number),
                                   fmt::format("{}", i.unknowns),
                                   i.anew ? "1" : "0",
                                   number(i.quality)};
      for (double seconds : i.times.processor)
        row.push_back(number(1e3 * seconds));
      row.push_back(number(1e3 * i.times.total_processor()));
      row.push_back(number(1e3 * i.times.total_wall()));
      std::string failure = i.failure;
      std::replace(failure.begin(), failure.end(), ',', ';');
      std::replace(failure.begin(), failure.end(), '\n', ' ');
      row.push_back(failure);
      increments.add(row);
    }
    summary.add({run.scenario, run.name, number(run.fine), fmt::format("{}", run.repeat),
                 fmt::format("{}", run.increments.back().unknowns), number(run.error), number(run.opening.volume),
                 number(run.opening.marked), number(run.opening.force), number(run.force_error),
                 number(1e3 * run.mean_processor()), number(1e3 * run.median_processor()),
                 number(1e3 * run.mean_wall()), number(run.condition), number(run.smallest_quality()),
                 fmt::format("{}", run.failures()), number(run.peak_memory / 1e6)});
  }
  increments.write(out / "increments.csv");
  summary.write(out / "runs.csv");
  app::Table table(
      {"scenario", "error", "back_end", "processor_ms", "ratio", "lowest", "highest", "against", "coarsest_is_better"});
  for (const Ratio& r : ratios)
    table.add({r.scenario, number(r.error), r.name, number(1e3 * r.cost), number(r.ratio), number(r.lowest),
               number(r.highest), r.against, r.finer ? "1" : "0"});
  table.write(out / "ratios.csv");
}

/// The last run of the first repeat of every back end in a scenario.
std::vector<const Run*> finest_runs(const std::vector<Run>& runs, const std::string& scenario) {
  std::vector<const Run*> chosen;
  for (const std::string& name : distinct(runs, &Run::name, scenario)) {
    const Run* finest = nullptr;
    for (const Run& run : runs)
      if (run.scenario == scenario && run.name == name && run.repeat == 0 && std::isfinite(run.error))
        finest = &run;
    if (finest != nullptr)
      chosen.push_back(finest);
  }
  return chosen;
}

void write_markdown(const std::vector<Run>& runs, const std::vector<Ratio>& ratios, const std::filesystem::path& file) {
  std::ofstream out(file);
  for (const std::string& scenario : distinct(runs, &Run::scenario, "")) {
    out << "### " << scenario
        << "\n\nTime an increment at equal opening error, strongest first (processor time, median "
        << "of the repeats; ratio to the cheapest of ours, range):\n\n| error | back end | ms | ratio | range |\n"
        << "|---|---|---|---|---|\n";
    for (const Ratio& r : ratios)
      if (r.scenario == scenario)
        out << fmt::format("| {:g} % | `{}` | {}{} | {} | {} |\n", 100 * r.error, r.name, r.finer ? "<= " : "",
                           std::isfinite(r.cost) ? cell(1e3 * r.cost, "{:.3g}") : "not reached",
                           cell(r.ratio, "{:.2f}"),
                           std::isfinite(r.ratio) ? fmt::format("{:.2f} to {:.2f}", r.lowest, r.highest) : "-");
    out << "\nEvery run, mean of the repeats:\n\n| back end | size, m | unknowns | error, % | force error, % | ms | "
           "topology | meshing | neighbours | assembly | factorisation | solve | condition | quality | failures | "
           "peak, "
           "MB |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
    for (const std::string& name : distinct(runs, &Run::name, scenario)) {
      std::vector<double> sizes;
      for (const Run& run : runs)
        if (run.scenario == scenario && run.name == name &&
            std::find(sizes.begin(), sizes.end(), run.fine) == sizes.end())
          sizes.push_back(run.fine);
      for (double size : sizes) {
        std::vector<const Run*> same;
        for (const Run& run : runs)
          if (run.scenario == scenario && run.name == name && run.fine == size)
            same.push_back(&run);
        const auto middle = [&](auto&& of) {
          double sum = 0;
          for (const Run* run : same)
            sum += of(*run);
          return sum / static_cast<double>(same.size());
        };
        out << fmt::format("| `{}` | {:.4g} | {} | {} | {} | {}", name, size, same.front()->increments.back().unknowns,
                           cell(100 * same.front()->error, "{:.2f}"), cell(100 * same.front()->force_error, "{:.2f}"),
                           cell(1e3 * middle([](const Run& r) { return r.mean_processor(); }), "{:.3g}"));
        for (int s = 0; s < stage_count; ++s)
          out << " | " << cell(1e3 * middle([s](const Run& r) { return r.mean_stage(s); }), "{:.3g}");
        out << fmt::format(" | {} | {} | {} | {:.0f} |\n", cell(same.front()->condition, "{:.1e}"),
                           cell(same.front()->smallest_quality(), "{:.2g}"), same.front()->failures(),
                           same.front()->peak_memory / 1e6);
      }
    }
    out << "\n";
  }
}

app::Figure error_cost_figure(const std::vector<Run>& runs, const std::string& scenario) {
  app::Figure figure{scenario + ": error of the opening against time an increment",
                     "processor time an increment / ms",
                     "relative error of the opening",
                     true,
                     true,
                     {}};
  for (const std::string& name : distinct(runs, &Run::name, scenario)) {
    app::Series series{name, {}, {}};
    for (const Run& run : runs)
      if (run.scenario == scenario && run.name == name && run.repeat == 0 && run.error > 0 &&
          run.mean_processor() > 0) {
        series.x.push_back(1e3 * run.mean_processor());
        series.y.push_back(run.error);
      }
    if (!series.x.empty())
      figure.series.push_back(series);
  }
  return figure;
}

/// Stages on top of one another: a bar for every back end at its finest size, mean over the increments, as SVG.
void write_stages(const std::vector<Run>& runs, const std::string& scenario, const std::filesystem::path& file) {
  constexpr std::array<const char*, stage_count> colours{"#CC79A7", "#E69F00", "#56B4E9",
                                                         "#0072B2", "#D55E00", "#009E73"};
  constexpr int left = 270, bar = 22, step = 32, width = 900, plot = width - left - 90, top = 70;
  std::vector<const Run*> chosen = finest_runs(runs, scenario);
  std::erase_if(chosen, [](const Run* run) { return !(run->mean_processor() > 0); });
  double longest = 1e-9;
  for (const Run* run : chosen)
    longest = std::max(longest, run->mean_processor());
  std::ofstream out(file);
  out << fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" "
                     "font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"{0}\" height=\"{1}\" "
                     "fill=\"white\"/>\n<text x=\"{2}\" y=\"22\" font-size=\"15\">{3}: processor time an "
                     "increment by stage, finest size of each, ms</text>\n",
                     width, top + step * std::ssize(chosen) + 10, 12, scenario);
  for (std::size_t s = 0; s < stage_count; ++s)
    out << fmt::format("<rect x=\"{}\" y=\"38\" width=\"14\" height=\"14\" fill=\"{}\"/><text x=\"{}\" "
                       "y=\"50\">{}</text>\n",
                       12 + 125 * s, colours[s], 31 + 125 * s, stage_names[s]);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const auto y = top + step * static_cast<int>(i);
    out << fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{} {:g} m, {:.1f} %</text>\n", left - 8, y + 16,
                       chosen[i]->name, chosen[i]->fine, 100 * chosen[i]->error);
    double from = left;
    for (int s = 0; s < stage_count; ++s) {
      const double seconds = chosen[i]->mean_stage(s), length = plot * seconds / longest;
      if (!(length > 0))
        continue;
      out << fmt::format("<rect x=\"{:.2f}\" y=\"{}\" width=\"{:.2f}\" height=\"{}\" fill=\"{}\"/>\n", from, y, length,
                         bar, colours[static_cast<std::size_t>(s)]);
      from += length;
    }
    out << fmt::format("<text x=\"{:.2f}\" y=\"{}\">{:.3g}</text>\n", from + 6, y + 16,
                       1e3 * chosen[i]->mean_processor());
  }
  out << "</svg>\n";
}

app::Figure growth_figure(const std::vector<Run>& runs, const std::string& scenario, bool unknowns) {
  app::Figure figure{scenario + (unknowns ? ": unknowns while the cut grows" : ": time while the cut grows"),
                     "increment",
                     unknowns ? "unknowns over those at the start" : "processor time an increment / ms",
                     false,
                     !unknowns,
                     {}};
  for (const Run* run : finest_runs(runs, scenario)) {
    app::Series series{run->name, {}, {}};
    for (const Increment& i : run->increments)
      if (i.failure.empty() && (unknowns || i.number > run->increments.front().number)) {
        series.x.push_back(i.number);
        series.y.push_back(unknowns ? static_cast<double>(i.unknowns) / run->increments.front().unknowns
                                    : 1e3 * i.times.total_processor());
      }
    if (!series.x.empty())
      figure.series.push_back(series);
  }
  return figure;
}

} // namespace

void write_tables(const std::vector<Run>& runs, const std::vector<Ratio>& ratios, const ExperimentContext& context) {
  write_csv(runs, ratios, context.out);
  write_markdown(runs, ratios, context.out / "tables.md");
  for (const std::string& scenario : distinct(runs, &Run::scenario, "")) {
    app::write_png(error_cost_figure(runs, scenario), context.out / (scenario + "_error_cost.png"));
    write_stages(runs, scenario, context.out / (scenario + "_stages.svg"));
    app::write_png(growth_figure(runs, scenario, false), context.out / (scenario + "_growth.png"));
    app::write_png(growth_figure(runs, scenario, true), context.out / (scenario + "_unknowns.png"));
  }
}

} // namespace spherecut::experiments::ledger
