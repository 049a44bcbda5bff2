#include "tools/tradeoff/tradeoff_report.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

#include "core/error.h"
#include "core/json.h"
#include "core/text.h"
#include "rt/passes/pass_list.h"
#include "tools/report/lists.h"

namespace hpr {
namespace {

/// JSON has no NaN and no infinity: null.
Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json();
}

double number_of(const Json& json, double otherwise) {
  return json.is_number() ? json.get<double>() : otherwise;
}

/// What reads as a number is one.
Json knob_value(const std::string& text) {
  double value = 0.0;
  const auto [stopped, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && stopped == text.data() + text.size() && std::isfinite(value)) {
    std::int64_t whole = 0;
    const auto as_whole = std::from_chars(text.data(), text.data() + text.size(), whole);
    if (as_whole.ec == std::errc() && as_whole.ptr == text.data() + text.size()) return whole;
    return value;
  }
  return text;
}

Json knobs_json(const KnobValues& knobs) {
  Json json = Json::object();
  for (const auto& [knob, value] : knobs) json[knob] = knob_value(value);
  return json;
}

Json error_json(const PictureError& error, std::size_t width) {
  return {{"rmse", number(error.rmse)},
          {"relmse", number(error.relmse)},
          {"relmse_untrimmed", number(error.relmse_all)},
          {"psnr", number(error.psnr)},
          {"ssim", number(error.ssim)},
          {"flip", number(error.flip)},
          {"mean", number(error.mean)},
          {"mean_error", number(error.mean_error)},
          {"worst",
           {{"x", error.worst_pixel % std::max<std::size_t>(width, 1)},
            {"y", error.worst_pixel / std::max<std::size_t>(width, 1)},
            {"value", number(error.worst)}}}};
}

Json point_json(const TradeoffPoint& point, std::size_t width) {
  Json passes = Json::array();
  for (const PassTime& time : point.times) passes.push_back({{"name", time.name}, {"ms", time.ms}});
  Json rays{{"primary", point.rays.primary}};
  for (const PassInfo& pass : all_passes()) rays[pass.name] = point.rays[pass.id];
  return {{"knobs", knobs_json(point.knobs)},
          {"ms",
           {{"median", point.median_ms()},
            {"min", std::ranges::min(point.ms)},
            {"max", std::ranges::max(point.ms)},
            {"frames", point.ms.size()}}},
          {"error", error_json(point.error, width)},
          {"pareto", point.pareto},
          {"samples", point.samples},
          {"passes", passes},
          {"rays", rays},
          {"not_finite", point.rays.not_finite},
          {"bytes_sent", point.bytes_sent}};
}

std::string metric_text(const std::string& metric, const PictureError& error) {
  const double value = error.of(metric);
  if (std::isnan(value)) return "-";
  return metric == "psnr" ? fmt::format("{:.2f}", value) : fmt::format("{:.4g}", value);
}

/// The signed error of the mean, in per cent of the reference's.
std::string mean_text(const TradeoffReference& reference, const TradeoffPoint& point) {
  if (!(reference.mean > 0.0)) return "-";
  const double percent = 100.0 / reference.mean;
  std::string mean = fmt::format("{:+.2f}", percent * point.error.mean);
  if (!std::isfinite(point.error.mean_error)) return mean;
  return fmt::format("{} +- {:.2f}", mean, percent * point.error.mean_error);
}

using TableRows = std::vector<std::vector<std::string>>;

/// Names of the columns first.
TableRows table_rows(const TradeoffReport& report) {
  TableRows rows(1);
  std::ranges::copy(report.knobs, std::back_inserter(rows.front()));
  rows.front().emplace_back("ms");
  std::ranges::copy(report.metrics, std::back_inserter(rows.front()));
  rows.front().emplace_back("mean in %");
  for (const TradeoffPoint& point : report.points) {
    auto& row = rows.emplace_back();
    for (const auto& [knob, value] : point.knobs) row.push_back(value);
    row.push_back(fmt::format("{:.1f}", point.median_ms()));
    for (const std::string& metric : report.metrics) row.push_back(metric_text(metric, point.error));
    row.push_back(mean_text(report.reference, point));
  }
  return rows;
}

}  // namespace

std::string describe(const KnobValues& knobs) {
  std::string text;
  for (const auto& [knob, value] : knobs) text += fmt::format("{}{}={}", text.empty() ? "" : " ", knob, value);
  return text;
}

std::string command_for(const TradeoffReport& report, const TradeoffPoint& point) {
  std::vector<std::string> words{"hpr",
                                 "render",
                                 report.scene,
                                 "-o",
                                 "picture.png",
                                 "--size",
                                 fmt::format("{}x{}", report.size.width, report.size.height)};
  std::ranges::copy(report.base_options, std::back_inserter(words));
  for (auto [knob, value] : point.knobs) {
    std::ranges::replace(value, '+', ',');
    words.push_back(fmt::format("--{}={}", knob, value));
  }
  return shell_line(words);
}

std::string answer(const TradeoffReport& report) {
  if (!report.budget) return {};
  const std::string& metric = report.budget->ms ? report.metrics.front() : report.budget->metric;
  if (report.best) {
    const TradeoffPoint& best = report.points[*report.best];
    const std::string found = fmt::format("{} ({:.1f} ms, {} {})", describe(best.knobs), best.median_ms(), metric,
                                          metric_text(metric, best.error));
    return report.budget->ms ? fmt::format("within {:g} ms the most accurate is {}", *report.budget->ms, found)
                             : fmt::format("within {} {:g} the fastest is {}", metric, report.budget->error, found);
  }
  const auto closest = std::ranges::min_element(report.points, {}, [&](const TradeoffPoint& point) {
    return report.budget->ms ? point.median_ms() : badness(metric, point.error.of(metric));
  });
  return fmt::format("no point is within the budget; the closest is {} ({:.1f} ms, {} {})", describe(closest->knobs),
                     closest->median_ms(), metric, metric_text(metric, closest->error));
}

std::string tradeoff_table(const TradeoffReport& report) {
  const TableRows rows = table_rows(report);
  std::string text = fmt::format("{} at {}x{} against {}{}\n", report.scene, report.size.width, report.size.height,
                                 report.reference.how,
                                 report.reference.spp > 0 ? fmt::format(", {} samples", report.reference.spp) : "");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::string line = i > 0 && report.points[i - 1].pareto ? "*" : " ";
    for (std::size_t column = 0; column < rows[i].size(); ++column) {
      std::size_t width = 0;
      for (const auto& row : rows) width = std::max(width, row[column].size());
      line += fmt::format("  {:>{}}", rows[i][column], width);
    }
    text += line + "\n";
  }
  text += fmt::format("*: nothing is both faster and better by {}\n", report.metrics.front());
  for (const KnobSlope& slope : knob_slopes(report.points, std::span(report.metrics).first(1))) {
    if (slope.points < 3) continue;
    text += fmt::format("{} goes with {} to the power {:+.2f} +- {:.2f}{}\n", slope.metric, slope.knob, slope.slope,
                        slope.spread, slope.others.empty() ? "" : " at " + describe(slope.others));
  }
  if (report.budget) {
    text += answer(report) + "\n";
    if (report.best) text += "  " + command_for(report, report.points[*report.best]) + "\n";
  }
  return text;
}

std::string tradeoff_json(const TradeoffReport& report) {
  const auto width = static_cast<std::size_t>(report.size.width);
  Json points = Json::array();
  for (const TradeoffPoint& point : report.points) points.push_back(point_json(point, width));
  Json slopes = Json::array();
  for (const KnobSlope& slope : knob_slopes(report.points, report.metrics)) {
    slopes.push_back({{"knob", slope.knob},
                      {"at", knobs_json(slope.others)},
                      {"metric", slope.metric},
                      {"slope", slope.slope},
                      {"spread", slope.spread},
                      {"points", slope.points}});
  }
  Json best;
  if (report.best) {
    best = point_json(report.points[*report.best], width);
    best["command"] = command_for(report, report.points[*report.best]);
  }
  const Json json{
      {"schema", "hpr.tradeoff/1"},
      {"command", report.command},
      {"commit", kCommit},
      {"machine", {{"cpu", report.machine.cpu}, {"cores", report.machine.cores}, {"mpi", report.machine.mpi}}},
      {"ranks", report.ranks},
      {"threads", report.threads},
      {"scene", report.scene},
      {"size", fmt::format("{}x{}", report.size.width, report.size.height)},
      {"seed", report.seed},
      {"reference",
       {{"how", report.reference.how},
        {"spp", report.reference.spp > 0 ? Json(report.reference.spp) : Json()},
        {"estimated_relmse", number(report.reference.relmse)},
        {"mean", number(report.reference.mean)},
        {"cached", report.reference.cached}}},
      {"knobs", report.knobs},
      {"metrics", report.metrics},
      {"points", points},
      {"slopes", slopes},
      {"best_under_budget", best}};
  return json.dump(2) + "\n";
}

std::string tradeoff_csv(const TradeoffReport& report) {
  std::string text;
  for (const std::string& knob : report.knobs) text += knob + ",";
  text += "ms,ms_min,ms_max,rmse,relmse,relmse_untrimmed,psnr,ssim,flip,mean,mean_error,worst,pareto\n";
  for (const TradeoffPoint& point : report.points) {
    for (const auto& [knob, value] : point.knobs) text += csv_field(value) + ",";
    const PictureError& e = point.error;
    text += fmt::format("{},{},{}", point.median_ms(), std::ranges::min(point.ms), std::ranges::max(point.ms));
    for (const double value : {e.rmse, e.relmse, e.relmse_all, e.psnr, e.ssim, e.flip, e.mean, e.mean_error, e.worst}) {
      text += std::isfinite(value) ? fmt::format(",{}", value) : ",";
    }
    text += point.pareto ? ",1\n" : ",0\n";
  }
  return text;
}

std::string encode_points(const std::string& identity, const std::vector<TradeoffPoint>& points) {
  Json list = Json::array();
  for (const TradeoffPoint& point : points) {
    Json json = point_json(point, 1);
    Json values = Json::array();
    for (const auto& [knob, value] : point.knobs) values.push_back(Json::array({knob, value}));
    json["values"] = values;
    json["all_ms"] = point.ms;
    json["worst_pixel"] = point.error.worst_pixel;
    json["crop"] = point.crop_png;
    json["flip_crop"] = point.flip_png;
    list.push_back(std::move(json));
  }
  return Json{{"schema", "hpr.tradeoff-points/1"}, {"sweep", identity}, {"points", list}}.dump() + "\n";
}

std::vector<TradeoffPoint> decode_points(const std::string& text, const std::string& name,
                                         const std::string& identity) {
  try {
    const Json json = Json::parse(text);
    if (json.at("schema") != "hpr.tradeoff-points/1" || json.at("sweep") != identity) {
      throw Error(ExitCode::BadInput, name + ": these are the points of another sweep", "leave out --resume");
    }
    std::vector<TradeoffPoint> points;
    for (const Json& from : json.at("points").elements()) {
      TradeoffPoint point;
      for (const Json& value : from.at("values").elements()) {
        point.knobs.emplace_back(value[0].string(), value[1].string());
      }
      point.ms = from.at("all_ms").get<std::vector<double>>();
      if (point.ms.empty()) throw Error(ExitCode::BadInput, name + ": a point without times", "leave out --resume");
      for (const Json& time : from.at("passes").elements()) {
        point.times.push_back({time.at("name").string(), time.at("ms").get<double>()});
      }
      const Json& rays = from.at("rays");
      point.rays.primary = rays.at("primary").get<std::uint64_t>();
      for (const PassInfo& pass : all_passes()) point.rays[pass.id] = rays.at(pass.name).get<std::uint64_t>();
      point.rays.not_finite = from.at("not_finite").get<std::uint64_t>();
      point.bytes_sent = from.at("bytes_sent").get<std::size_t>();
      point.samples = from.at("samples").get<int>();
      const Json& error = from.at("error");
      const auto value = [&](const char* metric) { return number_of(error.at(metric), std::nan("")); };
      // Of equal pictures psnr is infinite, which JSON does not have.
      const double psnr = number_of(error.at("psnr"), value("rmse") == 0.0 ? HUGE_VAL : std::nan(""));
      point.error = {value("rmse"),
                     value("relmse"),
                     value("relmse_untrimmed"),
                     psnr,
                     value("ssim"),
                     value("flip"),
                     value("mean"),
                     value("mean_error"),
                     number_of(error.at("worst").at("value"), std::nan("")),
                     from.at("worst_pixel").get<std::size_t>()};
      point.crop_png = from.at("crop").string();
      point.flip_png = from.at("flip_crop").string();
      points.push_back(std::move(point));
    }
    return points;
  } catch (const JsonError&) {
    throw Error(ExitCode::BadInput, name + ": this is no file of a sweep's points", "leave out --resume");
  }
}

}  // namespace hpr
