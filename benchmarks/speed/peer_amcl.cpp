// AMCL's filter on one recorded drive: prints the seconds of each update, and the mean error (m).
// Built by laser_peers.py from the sources of the `amcl` package, whose wheel has the beam model alone.
// Usage: peer_amcl DRIVE MODEL PARTICLES; MODEL is field, prob or beam. DRIVE is what laser_peers.py writes.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <vector>

#include "nav2_amcl/map/map.hpp"
#include "nav2_amcl/motion_model/differential_motion_model.hpp"
#include "nav2_amcl/pf/pf.hpp"
#include "nav2_amcl/sensors/laser/laser.hpp"

using namespace nav2_amcl;

static pf_vector_t nowhere(void *) { return pf_vector_zero(); }

static double seconds() {  // of processor time
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec + 1e-9 * now.tv_nsec;
}

template <typename T> static T next(FILE * file) {
  T value;
  if (fread(&value, sizeof(T), 1, file) != 1) { exit(2); }
  return value;
}

static pf_vector_t pose(FILE * file) {
  pf_vector_t p;
  for (double & v : p.v) { v = next<double>(file); }
  return p;
}

int main(int count_of_words, char ** argv) {
  if (count_of_words < 4) { return 2; }
  FILE * file = fopen(argv[1], "rb");
  const char * name = argv[2];
  const int particles = atoi(argv[3]), beams = next<int32_t>(file), updates = next<int32_t>(file);
  map_t * map = map_alloc();
  map->size_x = next<int32_t>(file);
  map->size_y = next<int32_t>(file);
  map->scale = next<double>(file);
  // cells are numbered by their middles
  map->origin_x = next<double>(file) + (map->size_x / 2 + 0.5) * map->scale;
  map->origin_y = next<double>(file) + (map->size_y / 2 + 0.5) * map->scale;
  map->cells = static_cast<map_cell_t *>(calloc(map->size_x * map->size_y, sizeof(map_cell_t)));
  for (int k = 0; k < map->size_x * map->size_y; k++) { map->cells[k].occ_state = next<int8_t>(file); }
  const double reach = next<double>(file);
  pf_vector_t mount = pose(file), start = pose(file);

  std::unique_ptr<Laser> laser;
  if (!strcmp(name, "field")) {
    laser.reset(new LikelihoodFieldModel(0.5, 0.5, 0.2, 2.0, beams, map));
  } else if (!strcmp(name, "prob")) {
    laser.reset(new LikelihoodFieldModelProb(0.5, 0.5, 0.2, 2.0, false, 0.5, 0.3, 0.9, beams, map));
  } else {
    laser.reset(new BeamModel(0.5, 0.05, 0.05, 0.5, 0.2, 0.1, 0.0, beams, map));
  }
  laser->SetLaserPose(mount);
  DifferentialMotionModel motion;
  motion.initialize(0.02, 0.02, 0.02, 0.02, 0.02);
  srand48(0);
  pf_t * pf = pf_alloc(particles, particles, 0.0, 0.0, nowhere);
  pf_init(pf, start, pf_matrix_zero());

  double total = 0.0;
  for (int k = 0; k < updates; k++) {
    pf_vector_t odometry = pose(file), delta = pose(file), truth = pose(file);
    pose(file);  // the movement in the robot's frame, which is MRPT's
    LaserData data;
    data.laser = laser.get();
    data.range_count = next<int32_t>(file);
    data.range_max = reach;
    data.ranges = new double[data.range_count][2];
    for (int i = 0; i < data.range_count; i++) {
      data.ranges[i][0] = next<double>(file);
      data.ranges[i][1] = next<double>(file);
    }
    const double begin = seconds();
    if (k > 0) { motion.odometryUpdate(pf, odometry, delta); }
    laser->sensorUpdate(pf, &data);
    pf_update_resample(pf, nullptr);
    double best = -1.0, weight;
    pf_vector_t mean = pf_vector_zero(), some;
    pf_matrix_t spread;
    for (int c = 0; pf_get_cluster_stats(pf, c, &weight, &some, &spread); c++) {
      if (weight > best) { best = weight; mean = some; }
    }
    printf("%.9f\n", seconds() - begin);
    total += hypot(mean.v[0] - truth.v[0], mean.v[1] - truth.v[1]);
  }
  printf("%.4f\n", total / updates);
  return 0;
}
