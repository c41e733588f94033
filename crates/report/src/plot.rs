//! Plots: points and lines over two axes, each linear or logarithmic, as SVG and PNG.

use std::ops::Range;
use std::sync::OnceLock;

use epaint_default_fonts::UBUNTU_LIGHT;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder as _};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::register_font;

use crate::lettering::Lettered;
use crate::statistics::{Estimate, Spread};

/// Width and height of a plot in pixels, its legend apart.
const SIZE: [u32; 2] = [960, 620];
/// Height of a line of the legend, pixels.
const LEGEND_LINE: u32 = 22;
/// Height of the heading, two lines, pixels.
const HEADING: u32 = 60;
/// Ticks that an axis has room for.
const MOST_TICKS: usize = 12;
/// Name under which the font is registered; SVG viewers substitute their own sans-serif.
const FONT: &str = "sans-serif";

/// Radius of a dot, pixels.
const DOT: i32 = 4;
/// Size of a dot's name, pixels.
const NAME: i32 = 13;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Dots.
    Points,
    /// Circles around dots, joined by steps, which is what a Pareto front dominates up to.
    Front,
    /// A line through the points in their order.
    Line,
    /// Dots joined by a line.
    LinePoints,
}

/// A figure with what it may as well have been.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The figure.
    pub value: f64,
    /// Ends of its bar.
    pub bar: Option<[f64; 2]>,
}

impl Reading {
    /// Median, and a bar from quartile to quartile.
    #[must_use]
    pub fn of(spread: &Spread) -> Self {
        Self {
            value: spread.median,
            bar: Some([spread.lower_quartile, spread.upper_quartile]),
        }
    }
}

/// An estimate, and a bar one standard error to either side.
impl From<Estimate> for Reading {
    fn from(
        Estimate {
            value,
            standard_error,
        }: Estimate,
    ) -> Self {
        Self {
            value,
            bar: standard_error.map(|error| [value - error, value + error]),
        }
    }
}

impl From<f64> for Reading {
    fn from(value: f64) -> Self {
        Self { value, bar: None }
    }
}

/// A point with its name; empty: none.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Horizontal.
    pub x: Reading,
    /// Vertical.
    pub y: Reading,
    /// Written beside it where there is room.
    pub name: String,
}

impl Point {
    fn at(&self) -> (f64, f64) {
        (self.x.value, self.y.value)
    }
}

impl From<(f64, f64)> for Point {
    fn from((x, y): (f64, f64)) -> Self {
        Self {
            x: x.into(),
            y: y.into(),
            name: String::new(),
        }
    }
}

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Legend; empty: none.
    pub label: String,
    /// Points that a logarithmic axis cannot hold are left out, and counted in the legend.
    pub points: Vec<Point>,
    /// Drawn as.
    pub mark: Mark,
    /// Index into the palette.
    pub color: usize,
}

impl Series {
    fn has_label(&self) -> bool {
        !self.label.is_empty()
    }

    fn has_line(&self) -> bool {
        self.mark != Mark::Points
    }

    /// The points of its line.
    fn line(&self, log: bool) -> Vec<(f64, f64)> {
        let points: Vec<(f64, f64)> = self.held(log).map(Point::at).collect();
        if self.mark != Mark::Front {
            return points;
        }
        let corners = points.windows(2).map(|pair| (pair[1].0, pair[0].1));
        let steps = points.iter().copied().zip(corners);
        let mut line: Vec<(f64, f64)> = steps.flat_map(|(point, corner)| [point, corner]).collect();
        line.extend(points.last());
        line
    }

    /// The points that the axes can hold.
    fn held(&self, log: bool) -> impl Iterator<Item = &Point> {
        let fits = move |value: f64| value.is_finite() && (!log || value > 0.0);
        self.points
            .iter()
            .filter(move |point| fits(point.x.value) && fits(point.y.value))
    }

    /// The legend's words.
    fn legend(&self, log: bool) -> String {
        match self.points.len() - self.held(log).count() {
            0 => self.label.clone(),
            lost => format!("{} ({lost} not above 0, left out)", self.label),
        }
    }

    /// Radius and style of its points.
    fn dots(&self) -> Option<(i32, ShapeStyle)> {
        match self.mark {
            Mark::Line => None,
            Mark::Front => Some((2 * DOT, self.color().stroke_width(2))),
            // Where colours begin anew, dots are circles.
            _ if self.color >= PALETTE.len() => Some((DOT, self.color().stroke_width(1))),
            Mark::Points | Mark::LinePoints => Some((DOT, self.color().filled())),
        }
    }

    fn color(&self) -> RGBColor {
        PALETTE[self.color % PALETTE.len()]
    }
}

/// A plot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Heading: a line, and a smaller one below it.
    pub title: String,
    /// x axis: one quantity with its unit.
    pub x_label: String,
    /// y axis: one quantity with its unit.
    pub y_label: String,
    /// Both axes are logarithmic.
    pub log: bool,
    /// What is drawn.
    pub series: Vec<Series>,
}

/// Colours that stay apart for the colour blind (Okabe and Ito 2008, "Color Universal Design").
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(60, 60, 60),
];

/// Lower and upper end of an axis around the values, with a margin.
fn range(values: impl Iterator<Item = f64>, log: bool) -> Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite() && (!log || *value > 0.0))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    let (low, high) = if low > high { (1.0, 10.0) } else { (low, high) };
    if log {
        let margin = (high / low).powf(0.06).max(1.3);
        return low / margin..high * margin;
    }
    // Quantities are not negative here, and 0 belongs to a linear picture of a cost.
    let low = low.min(0.0);
    let high = if high > low { high } else { low + 1.0 };
    low..high + 0.06 * (high - low)
}

/// Round values within the range of a logarithmic axis, [`MOST_TICKS`] or little more. The library's own leave out most of
/// a decade that the range does not hold whole.
fn log_ticks(range: &Range<f64>) -> Vec<f64> {
    let with = |factors: &[f64], stride| round_values([range.start, range.end], factors, stride);
    // As many as fit: 1 2 5, else 1 3, else decades, else every other one.
    let found = [&[1.0, 2.0, 5.0][..], &[1.0, 3.0], &[1.0]]
        .map(|factors| with(factors, 1))
        .into_iter()
        .find(|ticks| ticks.len() <= MOST_TICKS)
        .unwrap_or_else(|| with(&[1.0], 2));
    // Within less than a decade there may be none of these.
    if found.len() < 3 {
        even_ticks(range, MOST_TICKS / 2)
    } else {
        found
    }
}

/// Factors times every so many powers of ten, as far as they lie within a range.
pub(crate) fn round_values([low, high]: [f64; 2], factors: &[f64], stride: usize) -> Vec<f64> {
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    decades
        .step_by(stride)
        .flat_map(|decade| factors.iter().map(move |f| f * 10.0_f64.powi(decade)))
        .filter(|value| (low..=high).contains(value))
        .collect()
}

/// Multiples of a round step.
fn even_ticks(range: &Range<f64>, most: usize) -> Vec<f64> {
    let rough = (range.end - range.start) / most as f64;
    let decade = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * decade)
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(rough);
    let first = (range.start / step).ceil() as i64;
    let last = (range.end / step).floor() as i64;
    (first..=last).map(|index| index as f64 * step).collect()
}

/// A number as short as it can be read.
#[must_use]
pub fn tick_text(value: f64) -> String {
    let size = value.abs();
    // From where on it is used, what it stands for, and its letter.
    let units = [(1e9, 1e9, "G"), (1e6, 1e6, "M"), (1e4, 1e3, "k")];
    if let Some((_, scale, unit)) = units.iter().find(|(least, ..)| size >= *least) {
        return format!("{}{unit}", plain((value / scale * 100.0).round() / 100.0));
    }
    if size == 0.0 {
        "0".to_owned()
    } else if size < 1e-3 {
        format!("{value:.0e}")
    } else {
        plain(value)
    }
}

/// Up to four decimals, without trailing zeros.
fn plain(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn has_font() -> bool {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    *REGISTERED.get_or_init(|| register_font(FONT, FontStyle::Normal, UBUNTU_LIGHT).is_ok())
}

/// Draws `chart`, as the bytes of a file for each of `svg` and `png`.
///
/// # Errors
/// What the plotting library says, one line.
pub fn draw(chart: &Chart) -> Result<[(&'static str, Vec<u8>); 2], String> {
    if !has_font() {
        return Err("the embedded font is unusable".to_owned());
    }
    let labels = chart.series.iter().filter(|series| series.has_label());
    let size = (SIZE[0], SIZE[1] + LEGEND_LINE * labels.count() as u32);
    let mut svg = String::new();
    render(chart, SVGBackend::with_string(&mut svg, size))?;
    let mut pixels = vec![0; size.0 as usize * size.1 as usize * 3];
    let bitmap = BitMapBackend::with_buffer(&mut pixels, size);
    render(chart, Lettered::new(bitmap, UBUNTU_LIGHT)?)?;
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(&pixels, size.0, size.1, ExtendedColorType::Rgb8)
        .map_err(|error| error.to_string())?;
    Ok([("svg", svg.into_bytes()), ("png", png)])
}

fn render(chart: &Chart, backend: impl DrawingBackend) -> Result<(), String> {
    let area = backend.into_drawing_area();
    draw_on(chart, &area).map_err(|error| error.to_string())?;
    area.present().map_err(|error| error.to_string())
}

type Drawn<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

fn draw_on<DB: DrawingBackend>(chart: &Chart, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
    area.fill(&WHITE)?;
    // The legend stands above the picture, where it hides nothing.
    let labels = || chart.series.iter().filter(|series| series.has_label());
    let (head, body) = area.split_vertically(HEADING + LEGEND_LINE * labels().count() as u32);
    for (line, text) in (0..).zip(chart.title.lines()) {
        let size = if line == 0 { 20 } else { 15 };
        head.draw(&Text::new(text, (20, 12 + 24 * line), (FONT, size)))?;
    }
    for (line, series) in labels().enumerate() {
        let y = (HEADING + LEGEND_LINE * line as u32 + LEGEND_LINE / 2) as i32;
        let color = series.color();
        if series.has_line() {
            let ends = [(84, y), (112, y)];
            head.draw(&PathElement::new(ends, color.stroke_width(2)))?;
        }
        if let Some((radius, style)) = series.dots() {
            head.draw(&Circle::new((98, y), radius, style))?;
        }
        head.draw(&Text::new(
            series.legend(chart.log),
            (124, y - 7),
            (FONT, 15),
        ))?;
    }
    let along = |axis: fn(&Point) -> Reading| {
        let held = chart
            .series
            .iter()
            .flat_map(|series| series.held(chart.log))
            .map(axis);
        let ends = held.flat_map(|reading| {
            let [low, high] = reading.bar.unwrap_or([reading.value; 2]);
            [reading.value, low, high]
        });
        range(ends, chart.log)
    };
    let x = along(|point| point.x);
    let y = along(|point| point.y);
    let mut builder = ChartBuilder::on(&body);
    builder
        .margin(14)
        .x_label_area_size(48)
        .y_label_area_size(72);
    if chart.log {
        let [x_ticks, y_ticks] = [&x, &y].map(log_ticks);
        let x = x.log_scale().with_key_points(x_ticks);
        let y = y.log_scale().with_key_points(y_ticks);
        draw_series(chart, builder.build_cartesian_2d(x, y)?)
    } else {
        draw_series(chart, builder.build_cartesian_2d(x, y)?)
    }
}

fn draw_series<DB: DrawingBackend, X, Y>(
    chart: &Chart,
    mut context: ChartContext<'_, DB, Cartesian2d<X, Y>>,
) -> Drawn<DB>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    context
        .configure_mesh()
        .x_desc(&chart.x_label)
        .y_desc(&chart.y_label)
        .x_label_formatter(&|value| tick_text(*value))
        .y_label_formatter(&|value| tick_text(*value))
        .axis_desc_style((FONT, 16))
        .label_style((FONT, 14))
        .bold_line_style(BLACK.mix(0.15))
        .light_line_style(TRANSPARENT)
        .draw()?;
    for series in &chart.series {
        if series.has_line() {
            let style = series
                .color()
                .stroke_width(if series.mark == Mark::Front { 1 } else { 2 });
            context.draw_series(LineSeries::new(series.line(chart.log), style))?;
        }
        if let Some((radius, style)) = series.dots() {
            let points = || series.held(chart.log);
            let bars = points().flat_map(|point| bars(point, chart.log));
            context.draw_series(bars.map(|ends| PathElement::new(ends, series.color())))?;
            context.draw_series(points().map(|point| Circle::new(point.at(), radius, style)))?;
        }
    }
    draw_names(chart, &context)
}

/// The ends of a point's bars, as far as an axis holds them.
fn bars(point: &Point, log: bool) -> impl Iterator<Item = [(f64, f64); 2]> {
    let (x, y) = point.at();
    let across = point.x.bar.map(|ends| ends.map(|end| (end, y)));
    let upright = point.y.bar.map(|ends| ends.map(|end| (x, end)));
    let fits = move |(x, y): (f64, f64)| !log || (x > 0.0 && y > 0.0);
    let both = across.into_iter().chain(upright);
    both.filter(move |ends| ends.iter().copied().all(fits))
}

/// A rectangle in pixels: left, top, right, bottom.
type Box4 = [i32; 4];

fn overlap(a: &Box4, b: &Box4) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// What dots, bars and lines cover.
fn drawn_over<DB: DrawingBackend, X, Y>(
    chart: &Chart,
    context: &ChartContext<'_, DB, Cartesian2d<X, Y>>,
) -> Vec<Box4>
where
    X: Ranged<ValueType = f64>,
    Y: Ranged<ValueType = f64>,
{
    let around = |(x, y): (i32, i32), by: i32| [x - by, y - by, x + by, y + by];
    let mut taken = Vec::new();
    let along = |from: (f64, f64), to: (f64, f64)| {
        let [from, to] = [from, to].map(|end| context.backend_coord(&end));
        let pixels = (to.0 - from.0).abs().max((to.1 - from.1).abs()).max(1);
        let at = move |step: i32| {
            let part = |a: i32, b: i32| a + (b - a) * step / pixels;
            around((part(from.0, to.0), part(from.1, to.1)), 1)
        };
        (0..=pixels).step_by(DOT as usize).map(at)
    };
    for series in &chart.series {
        if series.has_line() {
            let line = series.line(chart.log);
            let pieces = line.windows(2);
            taken.extend(pieces.flat_map(|ends| along(ends[0], ends[1])));
        }
        if let Some((radius, _)) = series.dots() {
            for point in series.held(chart.log) {
                taken.push(around(context.backend_coord(&point.at()), radius));
                let ends = bars(point, chart.log);
                taken.extend(ends.flat_map(|[from, to]| along(from, to)));
            }
        }
    }
    taken
}

/// Names beside the dots, where they cover nothing that is drawn and no other name; those of the front first.
fn draw_names<DB: DrawingBackend, X, Y>(
    chart: &Chart,
    context: &ChartContext<'_, DB, Cartesian2d<X, Y>>,
) -> Drawn<DB>
where
    X: Ranged<ValueType = f64>,
    Y: Ranged<ValueType = f64>,
{
    let area = context.plotting_area();
    let (across, down) = area.get_pixel_range();
    let dotted = || chart.series.iter().filter(|series| series.dots().is_some());
    let mut taken = drawn_over(chart, context);
    let (front, rest): (Vec<&Series>, Vec<&Series>) =
        dotted().partition(|series| series.mark == Mark::Front);
    let fronts: Vec<(f64, f64)> = front
        .iter()
        .flat_map(|series| series.held(chart.log).map(Point::at))
        .collect();
    for series in front.into_iter().chain(rest) {
        let color = series.color();
        let style = (FONT, NAME).into_text_style(area).color(&color);
        let named = series.held(chart.log);
        for point in named.filter(|point| !point.name.is_empty()) {
            // The front goes through dots of other series.
            if series.mark != Mark::Front && fronts.contains(&point.at()) {
                continue;
            }
            let (width, height) = area.estimate_text_size(&point.name, &style)?;
            let (width, height) = (width as i32, height as i32);
            let (x, y) = context.backend_coord(&point.at());
            let gap = 2 * DOT + 2;
            let places = [
                (gap, -height / 2),
                (-gap - width, -height / 2),
                (-width / 2, -gap - height),
                (-width / 2, gap),
                (gap, -gap - height),
                (gap, gap),
            ];
            let found = places.into_iter().find_map(|(dx, dy)| {
                let corner = (x + dx, y + dy);
                let cover = [corner.0, corner.1, corner.0 + width, corner.1 + height];
                let inside = cover[0] >= across.start
                    && cover[2] <= across.end
                    && cover[1] >= down.start
                    && cover[3] <= down.end;
                let is_free = inside && !taken.iter().any(|other| overlap(other, &cover));
                is_free.then_some(((dx, dy), cover))
            });
            if let Some((offset, cover)) = found {
                taken.push(cover);
                let name = Text::new(point.name.clone(), offset, style.clone());
                area.draw(&(EmptyElement::at(point.at()) + name))?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_hold_their_values() {
        let log = range([1.0, 1000.0, -1.0, f64::NAN].into_iter(), true);
        assert!(log.start < 1.0 && log.start > 0.0 && log.end > 1000.0);
        let linear = range([5.0, 20.0].into_iter(), false);
        assert!(linear.start == 0.0 && linear.end > 20.0);
        // A single value, and none, still make an axis.
        for values in [vec![3.0], vec![]] {
            for log in [true, false] {
                let axis = range(values.iter().copied(), log);
                assert!(axis.end > axis.start);
                assert!(!log || !log_ticks(&axis).is_empty());
            }
        }
    }

    #[test]
    fn ticks_never_crowd() {
        for (low, high) in [(1.0, 1.5), (1.0, 1e3), (1e-9, 1e9), (0.003, 70.0)] {
            let axis = range([low, high].into_iter(), true);
            let ticks = log_ticks(&axis);
            assert!((3..=20).contains(&ticks.len()), "{low} {high}: {ticks:?}");
            assert!(ticks.iter().all(|tick| axis.contains(tick)));
        }
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.5, "0.5"),
            (1000.0, "1000"),
            (20_000.0, "20k"),
            (16_384.0, "16.38k"),
            (2e6, "2M"),
            (0.0001, "1e-4"),
            (12.0, "12"),
        ] {
            assert_eq!(tick_text(value), text);
        }
    }

    #[test]
    fn both_files_hold_ink() {
        let chart = Chart {
            title: "A title".to_owned(),
            x_label: "ms per frame".to_owned(),
            y_label: "relative MSE".to_owned(),
            log: true,
            series: vec![Series {
                label: "a <series>".to_owned(),
                points: [(1.0, 0.1), (10.0, 0.01), (0.0, 5.0)]
                    .map(Point::from)
                    .into(),
                mark: Mark::LinePoints,
                color: 0,
            }],
        };
        let [(_, svg), (_, png)] = draw(&chart).unwrap();
        let svg = String::from_utf8(svg).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for text in [
            "A title",
            "ms per frame",
            "relative MSE",
            "a &lt;series&gt; (1 not above 0, left out)",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        let picture = image::load_from_memory(&png).unwrap().into_rgb8();
        assert_eq!(picture.dimensions(), (SIZE[0], SIZE[1] + LEGEND_LINE));
        // White paper, and letters on it: the title's rows hold dark pixels.
        let dark = |pixel: &image::Rgb<u8>| pixel.0.iter().all(|channel| *channel < 120);
        let title = picture.rows().take(40).flatten();
        assert!(title.filter(|pixel| dark(pixel)).count() > 50);
        assert!(picture.pixels().filter(|pixel| !dark(pixel)).count() > 500_000);
    }

    #[test]
    fn names_stand_where_nothing_else_does() {
        let point = |x, y, name: &str| Point {
            name: name.to_owned(),
            ..(x, y).into()
        };
        let series = |points: Vec<Point>, mark| Series {
            label: String::new(),
            points,
            mark,
            color: 0,
        };
        let mut chart = Chart {
            title: String::new(),
            x_label: String::new(),
            y_label: String::new(),
            log: false,
            series: vec![series(
                vec![point(1.0, 1.0, "first"), point(9.0, 9.0, "far")],
                Mark::Points,
            )],
        };
        let svg = |chart: &Chart| String::from_utf8(draw(chart).unwrap()[0].1.clone()).unwrap();
        assert!(svg(&chart).contains("first") && svg(&chart).contains("far"));
        // A cloud of dots around the first leaves its name no room; the front's name comes before it.
        let cloud =
            (0..200).flat_map(|x| (0..40).map(move |y| (f64::from(x) * 0.01, f64::from(y) * 0.05)));
        chart
            .series
            .push(series(cloud.map(Point::from).collect(), Mark::Points));
        assert!(!svg(&chart).contains("first") && svg(&chart).contains("far"));
        chart.series.pop();
        chart
            .series
            .push(series(vec![point(9.0, 9.0, "front")], Mark::Front));
        assert!(svg(&chart).contains("front"));
    }

    #[test]
    fn a_front_goes_in_steps() {
        let points = [(1.0, 8.0), (2.0, 4.0), (4.0, 1.0)].map(Point::from).into();
        let front = Series {
            label: String::new(),
            points,
            mark: Mark::Front,
            color: 0,
        };
        let steps = [(1.0, 8.0), (2.0, 8.0), (2.0, 4.0), (4.0, 4.0), (4.0, 1.0)];
        assert_eq!(front.line(true), steps);
    }
}
