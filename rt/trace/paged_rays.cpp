#include "rt/trace/paged_rays.h"

#include "core/timing.h"
#include "scene/pages/part_pages.h"

namespace hpr {

PagedRays::PagedRays(Scene& scene, const RaySpace& space) : scene_(scene), space_(space) {
  scene.part_pages->on_leave([this](std::size_t page) {
    std::erase_if(built_, [&](const auto& built) { return built.first.first == page; });
  });
}

PagedRays::~PagedRays() {
  scene_.part_pages->on_leave({});
}

void PagedRays::add(std::uint32_t number, std::vector<SurfaceRange> surfaces, const RayBuild& build) {
  contents_[number] = {std::move(surfaces), build};
  contents_[number].build.quality = BuildQuality::Low;
}

void PagedRays::remove(std::uint32_t number) {
  contents_.erase(number);
  std::erase_if(built_, [&](const auto& built) { return built.first.second == number; });
}

std::size_t PagedRays::pages() const {
  return scene_.part_pages->size();
}

std::span<const SurfaceRange> PagedRays::surfaces(std::size_t page) const {
  return surfaces_of_page(scene_, page);
}

std::vector<std::size_t> PagedRays::nearest_first() const {
  return scene_.part_pages->nearest_first();
}

void PagedRays::with(std::size_t page, const std::function<void()>& body) const {
  const PageInUse use(scene_, page);
  body();
}

const RayScene& PagedRays::ray_scene(std::size_t page, std::uint32_t number, int threads) {
  std::unique_ptr<RayScene>& built = built_[{page, number}];
  if (!built) {
    const trace::Span span("build ray scene of a page", "page", page);
    const Contents& contents = contents_.at(number);
    const std::vector<SurfaceRange> own =
        merged_ranges({surfaces(page).begin(), surfaces(page).end()}, scene_.triangles);
    built = std::make_unique<RayScene>(scene_, space_, threads, common_ranges(own, contents.surfaces), contents.build);
  }
  return *built;
}

}  // namespace hpr
