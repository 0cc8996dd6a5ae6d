/** The page's sections in their order. Each is loaded when it is shown: one that is broken takes no other with it. */
export const sections = [
  { id: "rig", title: "Rig", load: () => import("./rig.js") },
  { id: "calibrate", title: "Calibrate", load: () => import("./calibrate.js") },
  { id: "judge", title: "Judge", load: () => import("./judge.js") },
  { id: "takeaway", title: "Take away", load: () => import("./takeaway.js") },
];
