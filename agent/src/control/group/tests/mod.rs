mod explore;
mod network;
mod unit;
mod world;
