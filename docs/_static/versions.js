// A choice of the versions of this site beside its title: versions.json in the folder above names their folders.
addEventListener("DOMContentLoaded", async () => {
  const root = document.documentElement.dataset.content_root || "./";
  const answer = await fetch(root + "../versions.json").catch(() => null);
  const brand = document.querySelector(".sidebar-brand");
  if (!answer || !answer.ok || !brand) return;
  const here = new URL(root, location.href).pathname.split("/").filter(Boolean).pop();
  const choice = document.createElement("select");
  choice.setAttribute("aria-label", "version");
  for (const version of await answer.json()) {
    choice.add(new Option(version, version, false, version === here));
  }
  choice.addEventListener("change", () => location.assign(root + "../" + choice.value + "/index.html"));
  brand.after(choice);
});
