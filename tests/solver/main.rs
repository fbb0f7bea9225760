//! What a solve computes: what holds for every result, how good results are, and that their bits stay.

mod bits;
mod budget;
mod collars;
mod cost;
mod cuts;
mod draft;
mod features;
mod finer;
mod gap;
mod gaps;
mod hard_cases;
mod harm;
mod invariants;
mod keep;
mod noise;
mod open_borders;
mod pbd;
mod random;
mod reference;
mod roughness;
mod seams;
mod strips;
mod temporal;
mod welds;
