//! The registration of vendors: one line each gives module, robot-file table and constructors.

/// Declares the module of each vendor and [`DriverConfig`](super::DriverConfig) over all of them.
///
/// A vendor's module gives `Config`, a table with `deny_unknown_fields`, with the methods
/// `check(&self) -> Result<(), Problem>`, `driver(&self, &DriverSetup)` and
/// `emulator(&self, &DriverSetup)`.
macro_rules! vendors {
    ($($(#[$doc:meta])* $module:ident: $variant:ident),+ $(,)?) => {
        $(pub mod $module;)+

        /// Names of the vendors, as they stand under `driver` in a robot file.
        pub const VENDORS: &[&str] = &[$(stringify!($module)),+];

        /// The table `driver` of a robot file: one vendor and its settings.
        #[derive(Clone, Debug, PartialEq, serde::Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum DriverConfig {
            $($(#[$doc])* $variant($module::Config),)+
        }

        impl DriverConfig {
            /// Name of the vendor, one of [`VENDORS`].
            #[must_use]
            pub const fn vendor(&self) -> &'static str {
                match self {
                    $(Self::$variant(_) => stringify!($module),)+
                }
            }

            /// Builds the client's side.
            ///
            /// # Errors
            /// As [`DriverSetup::joint_count`]; [`SetupError::Config`] if the vendor's table does
            /// not fit the robot.
            pub fn driver(&self, setup: &DriverSetup) -> Result<Box<dyn Driver>, SetupError> {
                match self {
                    $(Self::$variant(config) => Ok(Box::new(config.driver(setup)?)),)+
                }
            }

            /// Builds the controller's side, with an emulated robot behind it.
            ///
            /// # Errors
            /// As [`DriverConfig::driver`].
            pub fn emulator(&self, setup: &DriverSetup) -> Result<Box<dyn Emulator>, SetupError> {
                match self {
                    $(Self::$variant(config) => Ok(Box::new(config.emulator(setup)?)),)+
                }
            }

            /// Finds values that no robot may have; paths begin below `driver`.
            pub(crate) fn check(&self) -> Result<(), crate::config::Problem> {
                match self {
                    $(Self::$variant(config) => {
                        config.check().map_err(|problem| problem.under(stringify!($module)))
                    })+
                }
            }
        }
    };
}

pub(super) use vendors;
