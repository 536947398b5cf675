// CSV files, the tables of the page in Markdown, and figures.
#include "experiments/remeshing_ledger/ledger.hpp"
#include "experiments/support/statistics.hpp"
#include "src/figure.hpp"

#include <algorithm>
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

/// Stages on top of one another: every line is the sum up to its stage, one place on the axis a back end.
app::Figure stages_figure(const std::vector<Run>& runs, const std::string& scenario) {
  app::Figure figure{scenario + ": time an increment, stages summed up from below",
                     "back end, in the order of the table, finest size",
                     "processor time / ms",
                     false,
                     false,
                     {}};
  const std::vector<const Run*> chosen = finest_runs(runs, scenario);
  std::vector<double> sum(chosen.size(), 0);
  for (int s = 0; s < stage_count; ++s) {
    app::Series series{"up to " + std::string(stage_names[static_cast<std::size_t>(s)]), {}, {}};
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      sum[i] += std::isfinite(chosen[i]->mean_stage(s)) ? 1e3 * chosen[i]->mean_stage(s) : 0;
      series.x.push_back(static_cast<double>(i) + 1);
      series.y.push_back(sum[i]);
    }
    figure.series.push_back(series);
  }
  return figure;
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
    app::write_png(stages_figure(runs, scenario), context.out / (scenario + "_stages.png"));
    app::write_png(growth_figure(runs, scenario, false), context.out / (scenario + "_growth.png"));
    app::write_png(growth_figure(runs, scenario, true), context.out / (scenario + "_unknowns.png"));
  }
}

} // namespace spherecut::experiments::ledger
