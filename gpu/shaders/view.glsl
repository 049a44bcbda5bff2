// What a picture shows: scene/view.h.

struct View {
  dvec3 eye;
  dvec3 right;
  dvec3 up;
  dvec3 back;
  double left_edge;
  double right_edge;
  double bottom_edge;
  double top_edge;
  double near_distance;
  double far_distance;  // orthographic only
  dvec2 jitter;
  ivec2 block;   // its upper left corner on the screen
  uvec2 size;    // of the block
  uvec2 screen;  // pixels of the whole screen
  uint orthographic;
  uint screen_number;
};
layout(buffer_reference, scalar) readonly buffer Views {
  View view;
};

struct Ray {
  dvec3 origin;
  dvec3 direction;  // one metre along the view's axis
};

Ray view_ray(View view, uvec2 pixel) {
  precise dvec2 at = (dvec2(view.block) + (dvec2(pixel) + 0.5) + view.jitter) / dvec2(view.screen);
  precise double x = view.left_edge + (view.right_edge - view.left_edge) * at.x;
  precise double y = view.top_edge - (view.top_edge - view.bottom_edge) * at.y;
  precise dvec3 direction;
  precise dvec3 origin;
  if (view.orthographic != 0u) {
    origin = view.eye + (view.right * x + view.up * y + view.back * double(0.0));
    direction = -view.back;
  } else {
    origin = view.eye;
    direction = view.right * x + view.up * y + view.back * double(-1.0);
  }
  return Ray(origin, direction);
}
