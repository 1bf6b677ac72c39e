// MRPT's filter on one recorded drive: prints the seconds of each update, and the mean error (m).
// Built by laser_peers.py with Debian's libmrpt-slam-dev. Usage: as of peer_amcl; MODEL is field.

#include <mrpt/bayes/CParticleFilter.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/random.h>
#include <mrpt/slam/CMonteCarloLocalization2D.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>

using namespace mrpt;

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

static poses::CPose2D pose(FILE * file) {
  const double x = next<double>(file), y = next<double>(file), heading = next<double>(file);
  return poses::CPose2D(x, y, heading);
}

int main(int count_of_words, char ** argv) {
  if (count_of_words < 4) { return 2; }
  FILE * file = fopen(argv[1], "rb");
  const int particles = atoi(argv[3]), beams = next<int32_t>(file), updates = next<int32_t>(file);
  const int width = next<int32_t>(file), height = next<int32_t>(file);
  const double side = next<double>(file), x = next<double>(file), y = next<double>(file);
  auto grid = maps::COccupancyGridMap2D::Create(x, x + width * side, y, y + height * side, side);
  for (int row = 0; row < height; row++) {
    for (int column = 0; column < width; column++) {
      const int8_t state = next<int8_t>(file);  // 1: occupied, 0: unknown, -1: free
      grid->setCell(column, row, state > 0 ? 0.0f : state < 0 ? 1.0f : 0.5f);
    }
  }
  const double reach = next<double>(file);
  const poses::CPose2D mount = pose(file), start = pose(file);
  auto & likelihood = grid->likelihoodOptions;
  likelihood.likelihoodMethod = maps::COccupancyGridMap2D::lmLikelihoodField_Thrun;
  likelihood.LF_stdHit = 0.2f;
  likelihood.LF_zHit = 0.95f;
  likelihood.LF_zRandom = 0.05f;
  likelihood.LF_maxRange = reach;
  likelihood.LF_maxCorrsDistance = 2.0f;

  random::getRandomGenerator().randomize(1);
  slam::CMonteCarloLocalization2D filter(particles);
  filter.options.metricMap = grid;
  filter.resetDeterministic(start.asTPose(), particles);
  bayes::CParticleFilter::TParticleFilterOptions options;
  options.PF_algorithm = bayes::CParticleFilter::pfStandardProposal;
  options.resamplingMethod = bayes::CParticleFilter::prSystematic;
  options.adaptiveSampleSize = false;
  bayes::CParticleFilter steps;
  steps.m_options = options;

  double total = 0.0;
  for (int k = 0; k < updates; k++) {
    pose(file);
    pose(file);
    const poses::CPose2D truth = pose(file), motion = pose(file);
    const int count = next<int32_t>(file);
    auto scan = obs::CObservation2DRangeScan::Create();
    scan->resizeScan(count);
    scan->maxRange = reach;
    scan->rightToLeft = true;
    scan->sensorPose = poses::CPose3D(mount);
    double first = 0.0, last = 0.0;
    for (int i = 0; i < count; i++) {
      const double range = next<double>(file), bearing = next<double>(file);
      if (i == 0) { first = bearing; }
      last = bearing;
      scan->setScanRange(i, range);
      scan->setScanRangeValidity(i, range < reach);
    }
    scan->aperture = last - first;
    likelihood.LF_decimation = std::max(1, (count + beams - 1) / beams);

    obs::CActionRobotMovement2D::TMotionModelOptions noise;
    noise.modelSelection = obs::CActionRobotMovement2D::mmGaussian;
    obs::CActionRobotMovement2D movement;
    const double begin = seconds();
    movement.computeFromOdometry(motion, noise);
    obs::CActionCollection actions;
    actions.insert(movement);
    obs::CSensoryFrame seen;
    seen.insert(scan);
    steps.executeOn(filter, &actions, &seen);
    poses::CPose2D mean;
    filter.getMean(mean);
    printf("%.9f\n", seconds() - begin);
    total += std::hypot(mean.x() - truth.x(), mean.y() - truth.y());
  }
  printf("%.4f\n", total / updates);
  return 0;
}
