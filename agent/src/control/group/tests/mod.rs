mod explore;
mod network;
mod readiness;
mod unit;
mod world;
