use serde::{Deserialize, Serialize};

/// Named parts of the body, fixed in the template, never chosen from data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Region {
    /// Front and sides of the waist.
    Belly,
    /// Breast and pectoral.
    Chest,
    /// Buttocks.
    Buttocks,
    /// Thighs.
    Thighs,
    /// Upper arms.
    UpperArms,
    /// Calves.
    Calves,
    /// Head and neck.
    Head,
    /// Hands.
    Hands,
    /// Feet.
    Feet,
    /// Forearms, shoulders, back, knees: what is left.
    Rest,
}

impl Region {
    /// All regions, in file order.
    pub const ALL: [Self; 10] = [
        Self::Belly,
        Self::Chest,
        Self::Buttocks,
        Self::Thighs,
        Self::UpperArms,
        Self::Calves,
        Self::Head,
        Self::Hands,
        Self::Feet,
        Self::Rest,
    ];

    /// `soft` of the measures: belly, chest, buttocks, thighs and upper arms.
    pub fn is_soft(self) -> bool {
        matches!(self, Self::Belly | Self::Chest | Self::Buttocks | Self::Thighs | Self::UpperArms)
    }

    /// Name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Belly => "belly",
            Self::Chest => "chest",
            Self::Buttocks => "buttocks",
            Self::Thighs => "thighs",
            Self::UpperArms => "upper-arms",
            Self::Calves => "calves",
            Self::Head => "head",
            Self::Hands => "hands",
            Self::Feet => "feet",
            Self::Rest => "rest",
        }
    }
}

/// The region of each vertex, `[V]`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionMap(pub Vec<Region>);

impl RegionMap {
    /// Vertices of a region, ascending.
    pub fn vertices(&self, region: Region) -> Vec<u32> {
        self.select(|r| r == region)
    }
    /// Vertices of all soft regions, ascending.
    pub fn soft(&self) -> Vec<u32> {
        self.select(Region::is_soft)
    }
    /// Vertices of no soft region except the calves' (reported by themselves): `rigid` of the measures.
    pub fn rigid(&self) -> Vec<u32> {
        self.select(|r| !r.is_soft() && r != Region::Calves)
    }
    fn select(&self, take: impl Fn(Region) -> bool) -> Vec<u32> {
        self.0.iter().enumerate().filter(|(_, r)| take(**r)).map(|(v, _)| v as u32).collect()
    }
}
